//! Records as bytes: a header with magic, version and checksum, then the records. Everything is checked when it is read.

use crate::{Elements, Record, Samples};

/// Version of the format; all others are refused, for records are quickly made anew.
pub const FORMAT_VERSION: u32 = 2;

const MAGIC: [u8; 8] = *b"FRLXRECS";
const HEADER: usize = 16;

/// Why bytes are not records.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The first bytes are not those of records.
    #[error("not a file of records: it does not start with FRLXRECS")]
    Magic,
    /// Written by another version of the program.
    #[error("records of version {found}, but this program reads {FORMAT_VERSION} only: make them anew")]
    Version {
        /// The version that the file states.
        found: u32,
    },
    /// Cut or changed on the way.
    #[error("records are damaged (checksum differs): make them anew")]
    Checksum,
    /// The content does not decode.
    #[error("records cannot be decoded: {0}")]
    Decode(#[from] postcard::Error),
    /// A number in a record makes no sense.
    #[error("record {record}: {what}")]
    Invalid {
        /// Number of the record, from 0.
        record: usize,
        /// What is wrong with it.
        what: &'static str,
    },
}

/// Writes records: magic, version, CRC-32 of the rest, then the records by postcard.
///
/// # Errors
/// [`CodecError::Decode`] if memory for the bytes cannot be had.
pub fn to_bytes(records: &[Record]) -> Result<Vec<u8>, CodecError> {
    let body = postcard::to_stdvec(records)?;
    let mut bytes = Vec::with_capacity(HEADER + body.len());
    bytes.extend(MAGIC);
    bytes.extend(FORMAT_VERSION.to_le_bytes());
    bytes.extend(crc32fast::hash(&body).to_le_bytes());
    bytes.extend(body);
    Ok(bytes)
}

/// Reads records and checks every length and number in them.
///
/// # Errors
/// As [`CodecError`] lists.
pub fn from_bytes(bytes: &[u8]) -> Result<Vec<Record>, CodecError> {
    let (header, body) = bytes.split_at_checked(HEADER).ok_or(CodecError::Magic)?;
    if header[..8] != MAGIC {
        return Err(CodecError::Magic);
    }
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    if word(8) != FORMAT_VERSION {
        return Err(CodecError::Version { found: word(8) });
    }
    if word(12) != crc32fast::hash(body) {
        return Err(CodecError::Checksum);
    }
    let records: Vec<Record> = postcard::from_bytes(body)?;
    for (number, record) in records.iter().enumerate() {
        check(record).map_err(|what| CodecError::Invalid { record: number, what })?;
    }
    Ok(records)
}

fn check(record: &Record) -> Result<(), &'static str> {
    let ensure = |holds: bool, what| if holds { Ok(()) } else { Err(what) };
    ensure(record.centre.is_finite(), "its centre is not finite")?;
    let [s, t, n] = record.frame;
    let orthonormal =
        (s.cross(t) - n).length() < 1e-3 && (s.length() - 1.0).abs() < 1e-3 && (n.length() - 1.0).abs() < 1e-3;
    ensure(orthonormal, "its frame is not orthonormal")?;
    ensure(record.radius >= 0.0 && record.harmonic_distance >= 0.0, "its radius is negative or not a number")?;
    check_samples(&record.samples)?;
    check_elements(&record.elements, record.samples.resolution())
}

fn check_samples(samples: &Samples) -> Result<(), &'static str> {
    let n = samples.resolution();
    if !(1..=crate::MAX_RESOLUTION).contains(&n) {
        return Err("its resolution is not in 1..=64");
    }
    let count = n * n;
    let lengths = [
        samples.jitter.len(),
        samples.radiance.len(),
        samples.background_share.len(),
        samples.distance.len(),
        samples.normal.len(),
        samples.view_dependent.len(),
    ];
    if lengths.iter().any(|&length| length != count) {
        return Err("a texture is not n x n");
    }
    if !samples.background_share.iter().all(|s| (0.0..=1.0).contains(s)) {
        return Err("a share is not in [0, 1]");
    }
    let unit = |jitter: &glam::Vec2| (0.0..=1.0).contains(&jitter.x) && (0.0..=1.0).contains(&jitter.y);
    let sane = samples.radiance.iter().all(|l| l.is_finite())
        && samples.distance.iter().all(|&d| d >= 0.0)
        && samples.normal.iter().all(|n| n.is_finite())
        && samples.jitter.iter().all(unit);
    if !sane {
        return Err("a texel is not finite");
    }
    Ok(())
}

fn check_elements(elements: &Elements, n: usize) -> Result<(), &'static str> {
    if elements.len() > n * n {
        return Err("it has more elements than texels");
    }
    let Elements { x, y, z, radiance, background_share, finite, .. } = elements;
    let floats = [x, y, z, background_share, finite].into_iter().chain(radiance);
    if !floats.flatten().all(|x| x.is_finite()) {
        return Err("an element is not finite");
    }
    if !elements.finite.iter().all(|&finite| finite == 0.0 || finite == 1.0) {
        return Err("an element is neither near nor at infinity");
    }
    if elements.size[elements.len()..].iter().any(|size| *size != [0; 2]) {
        return Err("its padding is not empty");
    }
    let mut covered = vec![false; n * n];
    for e in 0..elements.len() {
        let [i0, j0] = elements.start[e].map(usize::from);
        let [w, h] = elements.size[e].map(usize::from);
        if i0 + w > n || j0 + h > n {
            return Err("an element is outside the texture");
        }
        for texel in (j0..j0 + h).flat_map(|j| j * n + i0..j * n + i0 + w) {
            if std::mem::replace(&mut covered[texel], true) {
                return Err("its elements do not cover the texture once");
            }
        }
    }
    if covered.iter().all(|&c| c) { Ok(()) } else { Err("its elements do not cover the texture once") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RecordSettings, Validity};
    use glam::{Vec3, Vec3A};

    fn records() -> Vec<Record> {
        let samples = Samples::from_fn(8, |wi| {
            (Vec3::new(1.0, wi.x.abs(), 0.5), if wi.y > 0.5 { f32::INFINITY } else { 2.0 / wi.z }, Vec3A::NEG_Z)
        });
        let frame = hemimap::Frame::from_normal(Vec3A::new(0.6, 0.0, 0.8));
        vec![Record::new(Vec3A::ONE, frame, samples, &RecordSettings::default(), &Validity::default())]
    }

    #[test]
    fn records_come_back_bit_for_bit() {
        let original = records();
        assert_eq!(from_bytes(&to_bytes(&original).unwrap()).unwrap(), original);
    }

    #[test]
    fn every_damaged_byte_and_every_cut_is_found() {
        let bytes = to_bytes(&records()).unwrap();
        for at in (0..bytes.len()).step_by(7) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x40;
            assert!(from_bytes(&changed).is_err(), "byte {at}");
            assert!(from_bytes(&bytes[..at]).is_err(), "cut at {at}");
        }
    }

    #[test]
    fn other_versions_are_refused_by_number() {
        let mut bytes = to_bytes(&records()).unwrap();
        for version in [0, 1, 9] {
            bytes[8] = version;
            let error = from_bytes(&bytes).unwrap_err().to_string();
            assert!(error.contains(&format!("version {version}")), "{error}");
        }
    }

    #[test]
    fn numbers_that_make_no_sense_are_refused() {
        let wrong = |change: fn(&mut Record)| {
            let mut records = records();
            change(&mut records[0]);
            from_bytes(&to_bytes(&records).unwrap()).unwrap_err().to_string()
        };
        assert!(wrong(|r| r.radius = f32::NAN).contains("radius"));
        assert!(wrong(|r| r.samples.radiance[3].x = f32::INFINITY).contains("texel"));
        assert!(wrong(|r| r.elements.start[0] = [60, 0]).contains("outside"));
        assert!(wrong(|r| r.elements.start[0] = r.elements.start[1]).contains("cover"));
        assert!(wrong(|r| r.elements.size.fill([0; 2])).contains("cover"));
        assert!(
            wrong(|r| {
                r.elements.start.fill([0; 2]);
                r.elements.size.fill([0; 2]);
            })
            .contains("cover")
        );
        assert!(wrong(|r| r.elements.x.fill(f32::NAN)).contains("not finite"));
        assert!(wrong(|r| r.elements.finite[0] = 0.5).contains("infinity"));
        assert!(wrong(|r| r.samples.normal[2].x = f32::NAN).contains("texel"));
        assert!(wrong(|r| r.samples.jitter[2].x = 7.0).contains("texel"));
        assert!(wrong(|r| r.elements.x.truncate(3)).contains("decoded"));
        assert!(wrong(|r| r.elements.size.last_mut().unwrap()[0] = 255).contains("padding"));
        assert!(wrong(|r| r.frame[0] = Vec3::ZERO).contains("orthonormal"));
        assert!(wrong(|r| r.elements.layer_starts[1] = 1_000_000).contains("decoded"));
    }
}

//! Records as bytes: a header with magic, version and checksum, then the records. Everything is checked when it is
//! read.

use crate::Record;
use crate::read::{Unchecked, check};

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
/// [`CodecError::Invalid`] if a record could not be read back, for a radiance in it is not finite, say;
/// [`CodecError::Decode`] if memory for the bytes cannot be had.
pub fn to_bytes(records: &[Record]) -> Result<Vec<u8>, CodecError> {
    check_all(records)?;
    encode(records)
}

/// Finds what makes no sense in any record.
fn check_all(records: &[Record]) -> Result<(), CodecError> {
    let find = |(record, found)| check(found).map_err(|what| CodecError::Invalid { record, what });
    records.iter().enumerate().try_for_each(find)
}

fn encode(records: &[Record]) -> Result<Vec<u8>, CodecError> {
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
    // Unchecked, as postcard would not pass on what is wrong with which record.
    let unchecked: Vec<Unchecked> = postcard::from_bytes(body)?;
    let records: Vec<Record> = unchecked.into_iter().map(|Unchecked(record)| record).collect();
    check_all(&records)?;
    Ok(records)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RecordSettings, Samples, Validity};
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
    fn what_could_not_be_read_is_not_written() {
        let mut records = records();
        let sky = records[0].samples.distance.iter().position(|distance| distance.is_infinite()).unwrap();
        records[0].samples.normal[sky] = Vec3::NAN;
        assert_eq!(from_bytes(&to_bytes(&records).unwrap()).unwrap().len(), 1, "the sky has no normal");
        records[0].samples.radiance[3].x = f32::INFINITY;
        assert_eq!(to_bytes(&records).unwrap_err().to_string(), "record 0: a texel is not finite");
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
            from_bytes(&encode(&records).unwrap()).unwrap_err().to_string()
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
        assert!(wrong(|r| r.frame[1] += r.frame[0]).contains("orthonormal"), "skewed");
        assert!(wrong(|r| r.elements.layer_starts[1] = 1_000_000).contains("decoded"));
    }
}

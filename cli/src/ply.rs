//! Records of the cache as a cloud of points, for programs that show such.

use std::io::{self, Write};

use integrator::{RecordKind, RecordPoint};

use crate::encode::srgb_codes;

/// Writes records as a PLY file in text. The colour is that of the light at an `exposure` in stops, as in a PNG.
pub(crate) fn write(records: &[RecordPoint], exposure: f32, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    let mut header = format!("ply\nformat ascii 1.0\ncomment records of freelux\nelement vertex {}\n", records.len());
    for name in ["x", "y", "z", "nx", "ny", "nz", "reach", "radiance_r", "radiance_g", "radiance_b"] {
        header += &format!("property float {name}\n");
    }
    for name in ["red", "green", "blue", "irradiance"] {
        header += &format!("property uchar {name}\n");
    }
    out.write_all(header.as_bytes())?;
    out.write_all(b"end_header\n")?;
    let factor = exposure.exp2();
    for RecordPoint { kind, p, n, reach, radiance } in records {
        let [red, green, blue] = srgb_codes(*radiance * factor);
        let kind = u8::from(*kind == RecordKind::Irradiance);
        let (p, n, light) = (p.to_array(), n.to_array(), radiance.to_array());
        for number in p.iter().chain(&n).chain([reach]).chain(&light) {
            write!(out, "{number} ")?;
        }
        writeln!(out, "{red} {green} {blue} {kind}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn records_are_points_with_their_light() {
        let record = RecordPoint {
            kind: RecordKind::Irradiance,
            p: Vec3::new(1.0, -2.5, 1e-7),
            n: Vec3::Y,
            reach: 0.25,
            radiance: Vec3::new(0.25, 0.0, 1e9),
        };
        let mut file = Vec::new();
        write(&[record, RecordPoint { kind: RecordKind::Radiance, reach: 0.0, ..record }], 2.0, &mut file).unwrap();
        let text = String::from_utf8(file).unwrap();
        let (header, body) = text.split_once("end_header\n").expect("a header");
        assert!(header.starts_with("ply\nformat ascii 1.0\n") && header.contains("element vertex 2\n"), "{header}");
        assert_eq!(header.matches("property").count(), 14, "as many as there are columns");
        let lines: Vec<&str> = body.lines().collect();
        assert_eq!(lines[0], "1 -2.5 0.0000001 0 1 0 0.25 0.25 0 1000000000 255 0 255 1", "of irradiance");
        assert_eq!(lines[1], "1 -2.5 0.0000001 0 1 0 0 0.25 0 1000000000 255 0 255 0", "of radiance");
    }
}

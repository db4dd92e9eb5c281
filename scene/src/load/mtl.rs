//! MTL libraries as they are written; [`super::mtl_meaning`] says what they mean.

use std::path::Path;

use glam::Vec3;

use super::error::{LoadError, Place, quoted};
use super::files::{Files, check_name};
use super::limits;
use super::lines::{Lines, uncommented};
use super::warnings::Warnings;

/// A value with the line that gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct At<T> {
    pub(super) value: T,
    pub(super) line: usize,
}

/// One `newmtl` of a library; what the file does not say is `None`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct MtlMaterial {
    pub(super) name: String,
    /// `Kd`, in [0, 1].
    pub(super) diffuse: Option<Vec3>,
    /// `Ks`, in [0, 1].
    pub(super) specular: Option<Vec3>,
    /// `Ke`, at least 0.
    pub(super) emission: Option<Vec3>,
    /// `Tf`, in [0, 1].
    pub(super) filter: Option<Vec3>,
    /// `Ns`, at least 0.
    pub(super) exponent: Option<f32>,
    /// `Ni`, any finite number: whether it makes sense depends on the rest.
    pub(super) index: Option<At<f32>>,
    /// `d`, in [0, 1].
    pub(super) dissolve: Option<f32>,
    /// `Tr`, in [0, 1].
    pub(super) transparency: Option<f32>,
    /// `Pr`, in [0, 1].
    pub(super) roughness: Option<f32>,
    /// `Pm`, in [0, 1].
    pub(super) metalness: Option<f32>,
    /// `illum`.
    pub(super) illumination: Option<f32>,
    /// `map_Kd`.
    pub(super) diffuse_map: Option<At<String>>,
    /// `map_Ks`.
    pub(super) specular_map: Option<At<String>>,
    /// `map_Ke`.
    pub(super) emission_map: Option<At<String>>,
    /// `map_d`.
    pub(super) dissolve_map: Option<At<String>>,
}

/// Reads the library `path`, which was named at `place`.
pub(super) fn read(
    files: Files<'_>,
    path: &Path,
    place: Place<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<MtlMaterial>, LoadError> {
    let (file, _) = files.open(path, place, limits::FILE_BYTES)?;
    let mut lines = Lines::new(path, file);
    let mut materials: Vec<MtlMaterial> = Vec::new();
    while let Some(line) = lines.next()? {
        let line = line.trim().to_owned();
        let place = lines.place();
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((&line, ""));
        if key == "newmtl" {
            if materials.len() >= limits::MATERIALS {
                return Err(place.too_large(format!("more than {} materials", limits::MATERIALS), "use fewer"));
            }
            check_name(rest, place)?;
            materials.push(MtlMaterial { name: rest.trim().to_owned(), ..MtlMaterial::default() });
        } else if let Some(material) = materials.last_mut() {
            material.set(key, rest, place, warnings)?;
        } else if !key.is_empty() && !key.starts_with('#') {
            warnings.add(format!("{}: lines before the first newmtl left out", Place::file(path)));
        }
    }
    Ok(materials)
}

impl MtlMaterial {
    fn set(&mut self, key: &str, rest: &str, place: Place<'_>, warnings: &mut Warnings) -> Result<(), LoadError> {
        let value = Value { key, text: uncommented(rest).trim(), place };
        let line = place.line.unwrap_or_default();
        match key {
            "Kd" | "Ks" | "Ke" | "Tf" if value.text.starts_with("spectral") || value.text.starts_with("xyz") => {
                warnings.add(format!("{}: {key} as a spectrum or in XYZ left out", Place::file(place.file)));
            }
            "Kd" => self.diffuse = Some(value.color(1.0)?),
            "Ks" => self.specular = Some(value.color(1.0)?),
            "Tf" => self.filter = Some(value.color(1.0)?),
            "Ke" => self.emission = Some(value.color(f32::MAX)?),
            "Ns" => self.exponent = Some(value.number(0.0, f32::MAX)?),
            "Ni" => self.index = Some(At { value: value.number(f32::MIN, f32::MAX)?, line }),
            "d" => {
                self.dissolve = Some(Value { text: value.text.trim_start_matches("-halo"), ..value }.number(0.0, 1.0)?)
            }
            "Tr" => self.transparency = Some(value.number(0.0, 1.0)?),
            "Pr" => self.roughness = Some(value.number(0.0, 1.0)?),
            "Pm" => self.metalness = Some(value.number(0.0, 1.0)?),
            "illum" => self.illumination = Some(value.number(f32::MIN, f32::MAX)?),
            "map_Kd" => self.diffuse_map = map(rest, place, warnings)?,
            "map_Ks" => self.specular_map = map(rest, place, warnings)?,
            "map_Ke" => self.emission_map = map(rest, place, warnings)?,
            "map_d" => self.dissolve_map = map(rest, place, warnings)?,
            "" | "Ka" => {}
            _ if key.starts_with('#') => {}
            _ if key.len() > 20 => warnings.add(format!("{}: unknown keywords left out", Place::file(place.file))),
            _ => warnings.add(format!("{}: {key} is not used", Place::file(place.file))),
        }
        Ok(())
    }
}

/// The text after a keyword.
#[derive(Clone, Copy)]
struct Value<'a> {
    key: &'a str,
    text: &'a str,
    place: Place<'a>,
}

impl Value<'_> {
    /// One number in `[least, most]`.
    fn number(self, least: f32, most: f32) -> Result<f32, LoadError> {
        let word = self.text.split_ascii_whitespace().next().unwrap_or_default();
        let Ok(number) = word.parse::<f32>() else {
            let what = format!("{} of {} is not a number", quoted(word), self.key);
            return Err(self.place.invalid(what, "give a number"));
        };
        if number.is_finite() && (least..=most).contains(&number) {
            return Ok(number);
        }
        let advice = match (least, most) {
            _ if !number.is_finite() => "give a finite number".to_owned(),
            (_, f32::MAX) => format!("give a number of at least {least}"),
            _ => format!("give a number from {least} to {most}"),
        };
        Err(self.place.invalid(format!("{} {word} is out of range", self.key), advice))
    }

    /// Three numbers in [0, `most`], or one that stands for all three.
    fn color(self, most: f32) -> Result<Vec3, LoadError> {
        let words: Vec<&str> = self.text.split_ascii_whitespace().take(4).collect();
        let component = |word: &&str| Value { text: word, ..self }.number(0.0, most);
        match words.as_slice() {
            [grey] => Ok(Vec3::splat(component(grey)?)),
            [r, g, b, ..] => Ok(Vec3::new(component(r)?, component(g)?, component(b)?)),
            _ => {
                let what = format!("{} has {} numbers", self.key, words.len());
                Err(self.place.invalid(what, "give three numbers (red, green, blue), or one for grey"))
            }
        }
    }
}

/// The file name of a `map_` line without its options.
fn map(rest: &str, place: Place<'_>, warnings: &mut Warnings) -> Result<Option<At<String>>, LoadError> {
    let mut name = rest.split_once(" #").map_or(rest, |(text, _)| text).trim();
    while let Some((option, mut after)) = name.strip_prefix('-').and_then(|text| text.split_once(char::is_whitespace)) {
        let (least, most) = match option {
            "o" | "s" | "t" => (1, 3),
            "mm" => (2, 2),
            "blendu" | "blendv" | "cc" | "clamp" | "bm" | "boost" | "texres" | "imfchan" | "type" | "colorspace" => {
                (1, 1)
            }
            _ => break,
        };
        // A name may be a number too, so the last word is never taken for an argument.
        for taken in 0..most {
            let Some((word, tail)) = after.trim_start().split_once(char::is_whitespace) else { break };
            if taken >= least && word.parse::<f32>().is_err() {
                break;
            }
            after = tail;
        }
        name = after.trim_start();
        warnings.add(format!("{}: option -{option} of textures is not used", Place::file(place.file)));
    }
    check_name(name, place)?;
    let line = place.line.unwrap_or_default();
    Ok((!name.is_empty()).then(|| At { value: name.to_owned(), line }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<MtlMaterial>, LoadError> {
        let list = [("m.mtl", text.as_bytes())];
        let path = Path::new("m.mtl");
        read(Files::Embedded(&list), path, Place::file(path), &mut Warnings::default())
    }

    #[test]
    fn maps_lose_their_options_and_keep_blanks() {
        let name =
            |text: &str| parse(&format!("newmtl a\nmap_Kd {text}")).unwrap()[0].diffuse_map.clone().unwrap().value;
        assert_eq!(name("-s 2 2 x.png"), "x.png", "two of three arguments");
        assert_eq!(name("-o 0.1 diffuse map.jpg"), "diffuse map.jpg", "one argument, blank in the name");
        assert_eq!(name("-s 1 1 1 -clamp on 7"), "7", "two options, a number for a name");
        assert_eq!(name("-mm 0 1 -blendu off a.png # comment"), "a.png", "comment");
        assert_eq!(name("-x.png"), "-x.png", "not an option");
    }

    #[test]
    fn one_number_is_grey() {
        let materials = parse("newmtl  a b \nKd 0.5 # half\nKe 3\n\tTf 1 .5 0").unwrap();
        let expected = MtlMaterial {
            name: "a b".to_owned(),
            diffuse: Some(Vec3::splat(0.5)),
            emission: Some(Vec3::splat(3.0)),
            filter: Some(Vec3::new(1.0, 0.5, 0.0)),
            ..MtlMaterial::default()
        };
        assert_eq!(materials, [expected], "vendor forms");
    }
}

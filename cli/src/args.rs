//! How single arguments are written.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use glam::{UVec2, Vec3};
use integrator::{Method, Study};
use scene::limits;

/// A picture's size, `WIDTHxHEIGHT`. What is too large for 32 bits becomes the largest number, which the limit refuses.
pub(crate) fn size(text: &str) -> Result<UVec2, String> {
    let parse = |side: &str| side.parse().map(|side: u64| u32::try_from(side).unwrap_or(u32::MAX)).ok();
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some(UVec2::new(parse(width)?, parse(height)?)))
        .ok_or_else(|| "write it as 640x360".to_owned())
}

/// Three finite numbers, `x,y,z`.
pub(crate) fn vector(text: &str) -> Result<Vec3, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| finite(number.trim()).ok()).collect();
    match numbers.as_deref() {
        Some(numbers) if numbers.iter().any(|x| f64::from(x.abs()) > limits::COORDINATE) => {
            Err(format!("its numbers must be from {:e} to {:e}", -limits::COORDINATE, limits::COORDINATE))
        }
        Some(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err("write it as three numbers, 0,1.5,-3".to_owned()),
    }
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Result<f32, String> {
    match f32::from_str(text) {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("it must be a finite number".to_owned()),
    }
}

/// A finite number that is not negative.
pub(crate) fn not_negative(text: &str) -> Result<f32, String> {
    finite(text).and_then(|number| if number >= 0.0 { Ok(number) } else { Err("it must not be negative".to_owned()) })
}

/// A finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f32, String> {
    finite(text).and_then(|number| if number > 0.0 { Ok(number) } else { Err("it must be above 0".to_owned()) })
}

/// A relative error that can be asked for.
pub(crate) fn error(text: &str) -> Result<f32, String> {
    let (min, max) = integrator::ERROR_RANGE;
    match finite(text) {
        Ok(error) if (min..=max).contains(&error) => Ok(error),
        _ => Err(format!("it must lie between {min} and {max}: 0.02 is 2 %")),
    }
}

/// Stops of exposure: beyond these limits every picture is black or white.
pub(crate) fn stops(text: &str) -> Result<f32, String> {
    finite(text).and_then(|stops| {
        if stops.abs() <= 64.0 { Ok(stops) } else { Err("it must lie between -64 and 64".to_owned()) }
    })
}

/// A vertical angle of view in degrees.
pub(crate) fn angle(text: &str) -> Result<f32, String> {
    match finite(text) {
        // As in scene files.
        Ok(degrees) if (0.01..=179.0).contains(&degrees) => Ok(degrees),
        _ => Err("it must lie between 0.01 and 179 degrees".to_owned()),
    }
}

/// All methods.
const METHODS: [Method; 4] = [Method::Reproject, Method::Gather, Method::CacheOnly, Method::Path];

/// A method by its name.
pub(crate) fn method() -> impl TypedValueParser<Value = Method> {
    PossibleValuesParser::new(METHODS.map(Method::name)).map(|name| named(&name).expect("one of the possible values"))
}

fn named(name: &str) -> Option<Method> {
    METHODS.into_iter().find(|method| method.name() == name)
}

/// A method with settings of its own: a line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variant {
    /// As it was written.
    pub(crate) name: String,
    pub(crate) method: Method,
    pub(crate) study: Study,
}

/// A method and perhaps settings for study, `METHOD+NAME=VALUE+NAME=VALUE`.
pub(crate) fn variant(text: &str) -> Result<Variant, String> {
    let mut words = text.split('+');
    let method = words.next().and_then(named).ok_or_else(|| {
        format!(
            "write one of {}, perhaps with settings as reproject+coverage=rect",
            METHODS.map(Method::name).join(", ")
        )
    })?;
    let settings: Vec<StudySetting> = words.map(study).collect::<Result<_, _>>()?;
    Ok(Variant { name: text.to_owned(), method, study: all_studies(&settings) })
}

/// A single setting for study, checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct StudySetting {
    /// Its name.
    pub(crate) name: String,
    /// Its value as it was written.
    pub(crate) value: String,
}

/// A setting for study, `NAME=VALUE`.
pub(crate) fn study(text: &str) -> Result<StudySetting, String> {
    let (name, value) = text.split_once('=').ok_or_else(|| "write it as spacing=0.2".to_owned())?;
    Study::default().set(name, value).map_err(|error| error.to_string())?;
    Ok(StudySetting { name: name.to_owned(), value: value.to_owned() })
}

/// A setting for study that is an argument of its own, `--NAME VALUE`, and has these values.
pub(crate) fn choice<const N: usize>(
    name: &'static str,
    values: [&'static str; N],
) -> impl TypedValueParser<Value = StudySetting> {
    PossibleValuesParser::new(values).map(move |value| StudySetting { name: name.to_owned(), value })
}

/// All settings for study together; the last of a name counts.
pub(crate) fn all_studies<'a>(settings: impl IntoIterator<Item = &'a StudySetting>) -> Study {
    let mut study = Study::default();
    for setting in settings {
        study.set(&setting.name, &setting.value).expect("checked when it was parsed");
    }
    study
}

/// The kinds of pictures that are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OutputKind {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// A picture to be written; the suffix decides the kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Output {
    /// Where to.
    pub(crate) path: PathBuf,
    /// What kind.
    pub(crate) kind: OutputKind,
}

impl TryFrom<PathBuf> for Output {
    type Error = &'static str;

    fn try_from(path: PathBuf) -> Result<Self, Self::Error> {
        let suffix = path.extension().and_then(|suffix| suffix.to_str()).map(str::to_ascii_lowercase);
        match suffix.as_deref() {
            Some("exr") => Ok(Self { path, kind: OutputKind::Exr }),
            Some("png") => Ok(Self { path, kind: OutputKind::Png }),
            _ => Err("its suffix must be .exr or .png"),
        }
    }
}

/// A picture to be written, by any name that files can have.
pub(crate) fn output() -> impl TypedValueParser<Value = Output> {
    PathBufValueParser::new().try_map(Output::try_from)
}

/// A cloud of points to be written.
pub(crate) fn ply() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        let is_ply = path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("ply"));
        if is_ply { Ok(path) } else { Err("its suffix must be .ply") }
    })
}

#[cfg(test)]
mod tests {
    use integrator::Trails;

    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x360"), Ok(UVec2::new(640, 360)), "the usual way");
        assert_eq!(size("99999999999x1"), Ok(UVec2::new(u32::MAX, 1)), "left to the limit");
        for text in ["640", "640x", "x", "-1x4", "6.5x3", "1x2x3", ""] {
            assert!(size(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn vectors() {
        assert_eq!(vector("-1, 2.5,3e2"), Ok(Vec3::new(-1.0, 2.5, 300.0)), "signs, spaces and exponents");
        for text in ["1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "1,2,1e99", "1,2,-1e10", "a,b,c", ""] {
            assert!(vector(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn numbers_with_limits() {
        assert!(
            angle("39.3").is_ok() && angle("0").is_err() && angle("180").is_err() && angle("nan").is_err(),
            "angle"
        );
        assert!(stops("-3").is_ok() && stops("65").is_err() && stops("inf").is_err(), "stops");
        assert!(not_negative("0").is_ok() && not_negative("-0.1").is_err(), "not negative");
    }

    #[test]
    fn settings_for_study() {
        let set: Vec<_> = ["layers=8", "layers=32", "trail=all"].map(|text| study(text).unwrap()).to_vec();
        let all = all_studies(&set);
        assert_eq!((all.layers, all.trails), (Some(32), Some(Trails::All)), "the last of a name counts");
        for text in ["layers", "layers=", "speed=2", "trail=some"] {
            assert!(study(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn variants_are_methods_with_settings() {
        let found = variant("reproject+coverage=rect+trail=all").unwrap();
        assert_eq!(
            (found.method, found.study.rectangles, found.study.trails),
            (Method::Reproject, Some(true), Some(Trails::All)),
            "as written"
        );
        assert_eq!(variant("path").unwrap().study, Study::default(), "no settings");
        for text in ["", "magic", "path+", "+coverage=rect", "path+layers=1000"] {
            assert!(variant(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn the_suffix_decides() {
        let output = |text: &str| Output::try_from(PathBuf::from(text));
        assert_eq!(output("a/b.EXR").unwrap().kind, OutputKind::Exr, "in capitals too");
        assert_eq!(output("a.exr.png").unwrap().kind, OutputKind::Png, "the last one");
        for text in ["a", "a.jpg", ".png", "", "a/"] {
            assert!(output(text).is_err(), "{text:?}");
        }
    }
}

//! Records of measured renderings: one row each, as the CSV has it.

use std::path::Path;

use scene::read_file;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;

/// A rendering and its error. Fields of other programs may be missing, but for the first ones.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Record {
    /// The scene's name.
    pub(crate) scene: String,
    /// The method, with the settings that make it another line.
    pub(crate) method: String,
    /// What was turned for more accuracy; of other programs perhaps samples a pixel.
    pub(crate) quality: f64,
    /// Number of the rendering at this quality, from 0; each has a seed of its own.
    #[serde(default)]
    pub(crate) repeat: u32,
    /// The whole rendering with all its phases and the tables of lights, without loading and without the tree of boxes.
    pub(crate) seconds: f64,
    /// relMSE against the reference.
    pub(crate) relmse: f64,
    /// relMSE without the worst 0.1 % of the pixels.
    pub(crate) robust: f64,
    /// What a perfect picture would have, for the reference has noise; empty where that is unknown.
    #[serde(default)]
    pub(crate) reference_relmse: Option<f64>,
    /// The same without the least certain 0.1 %.
    #[serde(default)]
    pub(crate) reference_robust: Option<f64>,
    /// FLIP, mean over the pixels.
    #[serde(default)]
    pub(crate) flip: Option<f64>,
    /// The picture's mean over the reference's.
    #[serde(default)]
    pub(crate) ratio_of_means: Option<f64>,
    /// Pixels left out because they are not finite.
    #[serde(default)]
    pub(crate) not_finite: u64,
    /// Pixels.
    #[serde(default)]
    pub(crate) width: u32,
    #[serde(default)]
    pub(crate) height: u32,
    /// Seconds by phase, `name=seconds` with semicolons between.
    #[serde(default)]
    pub(crate) phases: String,
    /// Reading and checking files.
    #[serde(default)]
    pub(crate) load_seconds: Option<f64>,
    /// Building the tree of boxes.
    #[serde(default)]
    pub(crate) build_seconds: Option<f64>,
    /// Rays of all kinds.
    #[serde(default)]
    pub(crate) rays: u64,
    /// Records in the cache.
    #[serde(default)]
    pub(crate) records: u64,
    /// Scene, records, photons and film, bytes.
    #[serde(default)]
    pub(crate) memory_bytes: Option<u64>,
    /// Most memory of the process while it rendered, bytes.
    #[serde(default)]
    pub(crate) peak_memory_bytes: Option<u64>,
    #[serde(default)]
    pub(crate) threads: u32,
    #[serde(default)]
    pub(crate) cpu: String,
    #[serde(default)]
    pub(crate) version: String,
    /// The reference's file.
    #[serde(default)]
    pub(crate) reference: String,
}

/// Returns the records as CSV, with a head.
pub(crate) fn to_csv(records: &[Record]) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        writer.serialize(record).expect("numbers and text into memory");
    }
    writer.into_inner().expect("memory takes all")
}

/// Reads records from CSV: columns are found by their names, and unknown ones are passed over.
pub(crate) fn read(path: &Path) -> Result<Vec<Record>, Failure> {
    let bytes = read_file(path).map_err(Failure::input)?;
    let records: Result<Vec<Record>, csv::Error> = csv::Reader::from_reader(&bytes[..]).deserialize().collect();
    let refuse = |what: String| Failure::Input(format!("{}: {what}; give the CSV of a chart", path.display()));
    let records = records.map_err(|error| refuse(error.to_string()))?;
    if records.is_empty() {
        return Err(refuse("holds no rows".into()));
    }
    for (number, record) in records.iter().enumerate() {
        let Record { seconds, relmse, robust, quality, .. } = *record;
        let others = [record.reference_relmse, record.reference_robust, record.flip, record.ratio_of_means];
        let mut numbers = [relmse, robust, quality].into_iter().chain(others.into_iter().flatten());
        // No axis with a logarithm has a place for 0 seconds; a picture without any error is drawn at its end.
        if !(seconds > 0.0 && seconds.is_finite() && numbers.all(|number| number >= 0.0 && number.is_finite())) {
            return Err(refuse(format!("row {} has numbers that no rendering has", number + 1)));
        }
        if [&record.scene, &record.method].iter().any(|name| name.contains(char::is_control)) {
            return Err(refuse(format!("row {} has a name with control characters", number + 1)));
        }
    }
    Ok(records)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_and_foreign_columns_may_be_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let record = Record {
            scene: "a, \"b\"".into(),
            method: "path".into(),
            quality: 0.3,
            seconds: 1.25,
            relmse: 1e-3,
            robust: 8e-4,
            flip: Some(0.03),
            phases: "a=1;b=2".into(),
            ..Record::default()
        };
        std::fs::write(&path, to_csv(std::slice::from_ref(&record))).unwrap();
        assert_eq!(read(&path).unwrap(), [record], "every field");

        std::fs::write(&path, "method,scene,extra,quality,seconds,relmse,robust\nmitsuba,a,x,16,0.5,2e-3,1e-3\n")
            .unwrap();
        let read_back = read(&path).unwrap();
        assert_eq!((read_back[0].method.as_str(), read_back[0].flip), ("mitsuba", None), "by name");

        for bad in [
            "method,scene\na,b\n",
            "scene,method,quality,seconds,relmse,robust\na,b,1,-1,1,1\n",
            "scene,method,quality,seconds,relmse,robust\na,b,1,1,-0.1,1\n",
            "scene,method,quality,seconds,relmse,robust,flip\na,b,1,1,0,1,nan\n",
            "scene,method,quality,seconds,relmse,robust\na,\u{1b}b,1,1,0,1\n",
            "scene,method,quality,seconds,relmse,robust\n",
            "",
        ] {
            std::fs::write(&path, bad).unwrap();
            assert!(matches!(read(&path), Err(Failure::Input(line)) if line.contains("a.csv")), "{bad}");
        }
    }
}

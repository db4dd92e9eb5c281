//! From a scene and settings to a picture: which method, and how long it took.

use std::time::Instant;

use scene::Scene;

use crate::plan::Plan;
use crate::{Film, Method, NoSecondary, Progress, Settings, SettingsError, Statistics, four_terms, path};

/// A finished picture and what it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// The picture in its terms.
    pub film: Film,
    /// What was counted.
    pub statistics: Statistics,
}

/// Makes a picture of `scene` on all threads of the current rayon pool. The result depends on the scene and the settings alone, never on
/// the number of threads.
///
/// `progress` is called from several threads, a few hundred times a phase; calls may overtake each other by a step.
///
/// # Errors
///
/// When a setting is out of its range, see [`Settings::validate`].
pub fn render(
    scene: &Scene,
    settings: &Settings,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Rendering, SettingsError> {
    settings.validate()?;
    let start = Instant::now();
    let mut statistics = Statistics::default();
    let film = match settings.method {
        Method::Path => path::render(scene, settings, progress, &mut statistics),
        Method::Reproject | Method::Gather => {
            let plan = Plan::new(scene, settings);
            four_terms::render(scene, settings, &plan, &NoSecondary, &mut statistics, progress)
        }
    };
    statistics.render_seconds = start.elapsed().as_secs_f64();
    Ok(Rendering { film, statistics })
}

//! The Markdown beneath a chart: time to an error by method, and all that was measured.

use std::fmt::Write;

use super::lines::{Line, Measure, Net, Point, Reached};

/// The errors whose times are told.
const ERRORS: [f64; 3] = [1e-2, 1e-3, 3e-4];

/// What the marks mean; once for all tables.
pub(crate) const LEGEND: &str = "\
Times are those of the whole rendering with all its phases, without loading and the tree of boxes, interpolated on the lines of the
charts. In brackets: how many times less that is than the path tracer takes, both in the same run. The reference's own relMSE is
subtracted; an error below a third of it is not quoted (`below the reference`).

| mark | meaning |
|---|---|
| `<` | the cheapest picture is better already |
| `~` | not measured: the path tracer's error is taken to fall on as one over its time |
| `!` | a later picture lies above the error again |
| `not reached` | by no measured picture; the least error is named |
";

/// Returns the section of one scene; `facts` stand under its heading.
pub(crate) fn section(scene: &str, picture: &str, facts: &[String], lines: &[Line]) -> String {
    let mut text = format!("## {scene}\n\n![Error over time in {scene}]({picture})\n\n");
    for fact in facts {
        let _ = writeln!(text, "- {fact}");
    }
    for (name, measure) in [("robust", Measure::Robust), ("plain", Measure::Plain)] {
        let _ = writeln!(text, "\nTime to relMSE, {name}:\n");
        text.push_str(&times(lines, measure));
    }
    text.push_str("\nMeasured:\n\n");
    text.push_str(
        "| method | quality | seconds | relMSE | robust | FLIP | ratio of means |\n|---|---|---|---|---|---|---|\n",
    );
    for line in lines {
        for point in &line.points {
            text.push_str(&measured(&line.method, point));
        }
    }
    text
}

/// The table of one measure.
fn times(lines: &[Line], measure: Measure) -> String {
    let mut text = String::from("| method |");
    for error in ERRORS {
        let _ = write!(text, " {} |", power(error));
    }
    text.push('\n');
    text.push_str(&"|---".repeat(ERRORS.len() + 1));
    text.push_str("|\n");
    let path = lines.iter().find(|line| line.method == integrator::Method::Path.name());
    for line in lines {
        let _ = write!(text, "| {} |", line.method);
        for error in ERRORS {
            let reached = line.reach(error, measure);
            let of_path = path.filter(|path| !std::ptr::eq(*path, line)).map(|path| path.reach(error, measure));
            let _ = write!(text, " {} |", cell(reached, of_path));
        }
        text.push('\n');
    }
    text
}

/// A time and its ratio to the path tracer's.
fn cell(reached: Reached, of_path: Option<Reached>) -> String {
    let time = match reached {
        Reached::At { seconds, stays } => format!("{}{}", time(seconds), if stays { "" } else { " !" }),
        Reached::Before { seconds } => format!("< {}", time(seconds)),
        Reached::Extrapolated { seconds } => format!("~ {}", time(seconds)),
        Reached::Never { least } => format!("not reached ({})", net(least)),
        Reached::Unknowable => "below the reference".to_owned(),
    };
    let Some((of_path, (path_seconds, seconds))) =
        of_path.and_then(|of_path| Some((of_path, of_path.seconds().zip(reached.seconds())?)))
    else {
        return time;
    };
    // Less than a time makes more than a ratio, and the other way round; of both, nothing can be said.
    let sign = match (of_path, reached) {
        (Reached::Before { .. }, Reached::Before { .. }) => return time,
        (Reached::Before { .. }, _) => "< ",
        (_, Reached::Before { .. }) => "> ",
        (Reached::Extrapolated { .. }, _) => "~ ",
        _ => "",
    };
    format!("{time} ({sign}{})", factor(path_seconds / seconds))
}

fn measured(method: &str, point: &Point) -> String {
    let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    format!(
        "| {method} | {} | {} | {} | {} | {} | {} |\n",
        point.quality,
        digits(point.seconds),
        net(point.plain),
        net(point.robust),
        number(point.flip, 4),
        number(point.ratio_of_means, 4)
    )
}

fn net(net: Net) -> String {
    format!("{}{}", if net.is_floor { "< " } else { "" }, scientific(net.error))
}

/// Two digits, as 4.1e-4.
fn scientific(value: f64) -> String {
    format!("{value:.1e}")
}

/// A power of ten without its factor 1.
fn power(value: f64) -> String {
    format!("{value:e}")
}

fn time(seconds: f64) -> String {
    format!("{} s", digits(seconds))
}

fn factor(ratio: f64) -> String {
    format!("{}x", digits(ratio))
}

/// Two digits that count, and no more than the machine's noise allows.
fn digits(value: f64) -> String {
    match value {
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v if v >= 1.0 => format!("{v:.2}"),
        v => format!("{v:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::lines::lines;
    use super::super::record::Record;
    use super::*;

    fn records() -> Vec<Record> {
        let record = |method: &str, quality, seconds, error| Record {
            scene: "a".into(),
            method: method.into(),
            quality,
            seconds,
            relmse: error,
            robust: error,
            reference_relmse: Some(1.2e-3),
            reference_robust: Some(1.2e-3),
            ..Record::default()
        };
        // Net errors: 2e-2 and 2e-3; 1e-2 and 9e-4; 5e-3. The floor is 4e-4.
        vec![
            record("path", 0.1, 1.0, 2.12e-2),
            record("path", 1.0, 10.0, 3.2e-3),
            record("gather", 0.1, 1.0, 1.12e-2),
            record("gather", 1.0, 2.0, 2.1e-3),
            record("slow", 1.0, 4.0, 6.2e-3),
        ]
    }

    #[test]
    fn times_and_their_ratios_to_path() {
        let table = times(&lines(&records(), "a"), Measure::Robust);
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!(rows[0], "| method | 1e-2 | 1e-3 | 3e-4 |", "the head");
        assert_eq!(
            rows[2], "| path | 2.00 s | ~ 20.0 s | below the reference |",
            "interpolated, extrapolated, unknowable"
        );
        assert_eq!(rows[3], "| gather | < 1.00 s (> 2.00x) | 1.94 s (~ 10.3x) | below the reference |", "with ratios");
        assert_eq!(
            rows[4], "| slow | < 4.00 s (> 0.500x) | not reached (5.0e-3) | below the reference |",
            "a slow one"
        );
    }

    #[test]
    fn a_section_has_both_measures_and_every_point() {
        let text = section("a", "a.svg", &["256 x 256".into()], &lines(&records(), "a"));
        for words in [
            "## a\n",
            "](a.svg)",
            "- 256 x 256\n",
            "relMSE, robust:",
            "relMSE, plain:",
            "| gather | 1 | 2.00 | 9.0e-4 |",
        ] {
            assert!(text.contains(words), "{words} in\n{text}");
        }
        assert_eq!(text.lines().filter(|line| line.starts_with("| path ")).count(), 2 + 2, "two tables, two points");
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        assert_eq!([0.0123, 1.234, 12.34, 1234.0].map(digits), ["0.012", "1.23", "12.3", "1234"], "times");
        assert_eq!([power(3e-4), scientific(4.14e-4)], ["3e-4", "4.1e-4"], "errors");
    }
}

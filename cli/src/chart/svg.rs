//! The chart of a scene: error over time by method, both logarithmic, as an SVG that stands alone.

use std::fmt::Write;

use super::lines::{Line, Measure, Point};

/// Width of the picture and the frame of the chart in it, pixels; its height goes by the notes.
const WIDTH: f64 = 860.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 600.0;
const TOP: f64 = 50.0;
const BOTTOM: f64 = 410.0;
/// Between lines of small text.
const LINE_HEIGHT: f64 = 16.0;

/// Style of small text.
const SMALL: &str = "font-size=\"11\" fill=\"#333333\"";

/// Colours that stay apart for colour-blind eyes (Okabe and Ito 2008), each with a symbol of its own.
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999"];

/// What the chart tells beside its lines.
pub(crate) struct Texts<'a> {
    pub(crate) title: &'a str,
    /// Lines beneath the chart.
    pub(crate) notes: &'a [String],
    /// The reference's own relMSE, robust, where known.
    pub(crate) own: Option<f64>,
}

/// A logarithmic axis: an interval of values on an interval of pixels.
#[derive(Debug, Clone, Copy)]
struct Axis {
    /// Decimal logarithms.
    from: f64,
    to: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// Takes in all values that are positive and finite, and a little more.
    fn around(values: impl Iterator<Item = f64>, start: f64, end: f64) -> Self {
        /// Free space at both ends, decades.
        const MARGIN: f64 = 0.1;
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| *value > 0.0 && value.is_finite()).map(f64::log10) {
            from = from.min(value - MARGIN);
            to = to.max(value + MARGIN);
        }
        if from > to {
            (from, to) = (-1.0, 1.0);
        }
        // Less than a decade would have no ticks.
        let missing = (1.0 - (to - from)).max(0.0) / 2.0;
        Self { from: from - missing, to: to + missing, start, end }
    }

    /// Where a value is drawn, at the end of the axis where it is beyond that, as 0 is.
    fn place(&self, value: f64) -> f64 {
        let value = value.log10().clamp(self.from, self.to);
        self.start + (value - self.from) / (self.to - self.from) * (self.end - self.start)
    }

    /// Values with a line, and whether that is a whole decade.
    fn ticks(&self) -> Vec<(f64, bool)> {
        #[expect(clippy::cast_possible_truncation, reason = "logarithms of numbers of 64 bits")]
        let (first, last) = (self.from.floor() as i32, self.to.ceil() as i32);
        let all = (first..=last)
            .flat_map(|decade| (1..10).map(move |digit| (f64::from(digit) * 10_f64.powi(decade), digit == 1)));
        all.filter(|(value, _)| (self.from..=self.to).contains(&value.log10())).collect()
    }
}

/// Draws the lines; robust errors with symbols, plain ones thin and dashed.
pub(crate) fn draw(texts: &Texts, lines: &[Line]) -> String {
    let points = || lines.iter().flat_map(|line| &line.points);
    let x = Axis::around(points().map(|point| point.seconds), LEFT, RIGHT);
    let errors = points().flat_map(|point| [point.plain.error, point.robust.error]);
    let y = Axis::around(errors.chain(texts.own), BOTTOM, TOP);
    let title = escaped(texts.title);
    let height = BOTTOM + 58.0 + texts.notes.len() as f64 * LINE_HEIGHT;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"13\" role=\"img\">\n<title>{title}</title>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    text(&mut svg, (LEFT, TOP - 20.0), "font-size=\"17\" font-weight=\"bold\"", texts.title);
    frame(&mut svg, x, y);
    if let Some(own) = texts.own {
        let at = y.place(own);
        let _ = writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{at:.1}\" x2=\"{RIGHT}\" y2=\"{at:.1}\" stroke=\"#555555\" stroke-width=\"1.5\" \
             stroke-dasharray=\"2 3\"/>"
        );
        text(
            &mut svg,
            (RIGHT - 4.0, at - 5.0),
            "font-size=\"11\" fill=\"#555555\" text-anchor=\"end\"",
            "the reference's own",
        );
    }
    for (number, line) in lines.iter().enumerate() {
        curve(&mut svg, x, y, line, number);
    }
    legend(&mut svg, lines);
    for (number, note) in texts.notes.iter().enumerate() {
        let place = (LEFT, BOTTOM + 58.0 + number as f64 * LINE_HEIGHT);
        text(&mut svg, place, "font-size=\"11\" fill=\"#555555\"", note);
    }
    svg.push_str("</svg>\n");
    svg
}

/// The grid, the frame, the ticks and what the axes are.
fn frame(svg: &mut String, x: Axis, y: Axis) {
    /// Where there are fewer decades, 2 and 5 are labelled as well.
    const FEW: f64 = 2.5;
    let style = |is_decade: bool| if is_decade { "#bbbbbb" } else { "#eeeeee" };
    let is_labelled = |axis: Axis, value: f64, is_decade: bool| {
        let digit = (value / 10_f64.powf(value.log10().floor() + 1e-9)).round();
        is_decade || (axis.to - axis.from < FEW && (digit == 2.0 || digit == 5.0))
    };
    for (value, is_decade) in x.ticks() {
        let at = x.place(value);
        let _ = writeln!(svg, "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"{}\"/>", style(is_decade));
        if is_labelled(x, value, is_decade) {
            text(svg, (at, BOTTOM + 18.0), "text-anchor=\"middle\"", &plain_number(value));
        }
    }
    for (value, is_decade) in y.ticks() {
        let at = y.place(value);
        let _ = writeln!(svg, "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"{}\"/>", style(is_decade));
        if is_labelled(y, value, is_decade) {
            text(svg, (LEFT - 8.0, at + 4.0), "text-anchor=\"end\"", &format!("{value:.0e}"));
        }
    }
    let _ = writeln!(
        svg,
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#333333\"/>",
        RIGHT - LEFT,
        BOTTOM - TOP
    );
    let middle = (LEFT + RIGHT) / 2.0;
    text(svg, (middle, BOTTOM + 36.0), "text-anchor=\"middle\"", "seconds for the whole rendering");
    let (at, height) = (22.0, (TOP + BOTTOM) / 2.0);
    let turned = format!("text-anchor=\"middle\" transform=\"rotate(-90 {at} {height})\"");
    text(svg, (at, height), &turned, "relMSE without the reference's own");
}

/// One method: the plain error behind, the robust one with its symbols before it.
fn curve(svg: &mut String, x: Axis, y: Axis, line: &Line, number: usize) {
    let colour = colour(number);
    let place = |point: &Point, measure: Measure| (x.place(point.seconds), y.place(point.net(measure).error));
    for (measure, style) in
        [(Measure::Plain, "stroke-width=\"1\" stroke-dasharray=\"5 4\""), (Measure::Robust, "stroke-width=\"2\"")]
    {
        let places: Vec<String> = line
            .points
            .iter()
            .map(|point| {
                let (x, y) = place(point, measure);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" {style} stroke-linejoin=\"round\"/>",
            places.join(" ")
        );
    }
    for point in &line.points {
        symbol(svg, place(point, Measure::Robust), number, point.robust.is_floor);
        let (x, y) = place(point, Measure::Plain);
        let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\" fill=\"{colour}\"/>");
    }
}

/// A circle, square, triangle or diamond; hollow where the error is lost in the reference's noise.
fn symbol(svg: &mut String, (x, y): (f64, f64), number: usize, is_hollow: bool) {
    let colour = colour(number);
    // Another one than that of the line that has the colour already.
    let shape = match (number + number / COLOURS.len()) % 4 {
        0 => format!("M{:.1} {y:.1}a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0z", x - 4.5),
        1 => format!("M{:.1} {:.1}h8v8h-8z", x - 4.0, y - 4.0),
        2 => format!("M{x:.1} {:.1}l5 9h-10z", y - 6.0),
        _ => format!("M{x:.1} {:.1}l5.5 5.5l-5.5 5.5l-5.5 -5.5z", y - 5.5),
    };
    let fill = if is_hollow { "#ffffff" } else { colour };
    let _ = writeln!(svg, "<path d=\"{shape}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>");
}

/// Methods, long ones with their settings for study beneath, and styles, right of the chart.
fn legend(svg: &mut String, lines: &[Line]) {
    /// What has more is as wide as the picture.
    const MOST_LETTERS: usize = 28;
    let left = RIGHT + 16.0;
    let mut y = TOP + 10.0;
    for (number, line) in lines.iter().enumerate() {
        let _ = writeln!(svg, "<path d=\"M{left} {y:.1}h28\" stroke=\"{}\" stroke-width=\"2\"/>", colour(number));
        symbol(svg, (left + 14.0, y), number, false);
        let (name, settings) = match line.method.split_once('+') {
            Some(parts) if line.method.len() > MOST_LETTERS => parts,
            _ => (&line.method[..], ""),
        };
        text(svg, (left + 36.0, y + 4.5), "", name);
        for setting in settings.split_terminator('+') {
            y += LINE_HEIGHT;
            text(svg, (left + 36.0, y + 4.0), SMALL, &format!("+ {setting}"));
        }
        y += 22.0;
    }
    y += 12.0;
    let styles = [
        ("stroke-width=\"2\"", "robust (solid): without the"),
        ("", "worst 0.1 % of the pixels"),
        ("stroke-width=\"1\" stroke-dasharray=\"5 4\"", "plain (dashed): all pixels"),
    ];
    for (style, words) in styles {
        if !style.is_empty() {
            let _ = writeln!(svg, "<path d=\"M{left} {y:.1}h28\" stroke=\"#333333\" {style}/>");
        }
        text(svg, (left + 36.0, y + 4.0), SMALL, words);
        y += LINE_HEIGHT;
    }
}

fn colour(number: usize) -> &'static str {
    COLOURS[number % COLOURS.len()]
}

/// A line of text; `style` is written as it is.
fn text(svg: &mut String, (x, y): (f64, f64), style: &str, words: &str) {
    let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{}</text>", escaped(words));
}

/// Seconds without an exponent.
fn plain_number(value: f64) -> String {
    let digits = usize::from(value < 0.999) * 3;
    let text = format!("{value:.digits$}");
    if digits > 0 { text.trim_end_matches('0').to_owned() } else { text }
}

/// Text without what has a meaning in XML, or none at all.
fn escaped(words: &str) -> String {
    let mut text = String::with_capacity(words.len());
    for letter in words.chars() {
        match letter {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '"' => text.push_str("&quot;"),
            letter if letter.is_control() => text.push('?'),
            letter => text.push(letter),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::lines::lines;
    use super::super::record::Record;
    use super::*;

    #[test]
    fn the_axis_is_logarithmic_with_its_ticks() {
        let axis = Axis::around([0.1, 10.0, 0.0, f64::NAN].into_iter(), 0.0, 220.0);
        assert!((axis.place(1.0) - 110.0).abs() < 1e-9, "the middle of the decades: {axis:?}");
        assert!((axis.place(10.0) - axis.place(1.0) - 100.0).abs() < 1e-9, "a decade is 100 of 220 pixels");
        let decades: Vec<f64> = axis.ticks().into_iter().filter(|tick| tick.1).map(|tick| tick.0).collect();
        assert_eq!(decades, [0.1, 1.0, 10.0], "whole decades");
        let one = Axis::around([3.0].into_iter(), 0.0, 100.0);
        assert!(one.ticks().len() >= 8, "a single value has a decade around it");
        assert!(Axis::around(std::iter::empty(), 0.0, 1.0).place(1.0).is_finite(), "and nothing has one too");
    }

    #[test]
    fn numbers_and_letters_are_written_as_a_reader_expects() {
        assert_eq!([0.05, 0.1, 1.0, 20.0].map(plain_number), ["0.05", "0.1", "1", "20"], "seconds");
        assert_eq!(escaped("a<b & \"c\"\u{7}"), "a&lt;b &amp; &quot;c&quot;?", "XML");
    }

    #[test]
    fn a_hollow_symbol_marks_what_the_reference_cannot_tell() {
        let record = |quality, robust| Record {
            scene: "a".into(),
            method: "path".into(),
            quality,
            seconds: quality,
            relmse: 0.1,
            robust,
            reference_robust: Some(1e-3),
            ..Record::default()
        };
        let lines = lines(&[record(1.0, 0.1), record(2.0, 1e-3)], "a");
        let svg = draw(&Texts { title: "a", notes: &[], own: Some(1e-3) }, &lines);
        assert_eq!(svg.matches("fill=\"#ffffff\" stroke=\"#0072b2\"").count(), 1, "one of the two points");
        assert_eq!(svg.matches("<polyline").count(), 2, "plain and robust");
        assert!(svg.contains(">path</text>"), "the legend");
    }

    #[test]
    fn settings_that_are_too_wide_have_rows_of_their_own() {
        let record = |method: &str| Record {
            scene: "a".into(),
            method: method.into(),
            quality: 1.0,
            seconds: 1.0,
            relmse: 0.1,
            robust: 0.1,
            ..Record::default()
        };
        let records = ["reproject+verify=0", "reproject+coverage=rect+trail=all"].map(record);
        let svg = draw(&Texts { title: "a", notes: &[], own: None }, &lines(&records, "a"));
        for words in ["reproject+verify=0", "reproject", "+ coverage=rect", "+ trail=all"] {
            assert!(svg.contains(&format!(">{words}</text>")), "{words} has a row of its own");
        }
    }
}

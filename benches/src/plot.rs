//! Panels with lines over logarithmic axes, as an SVG that stands alone.

use std::fmt::Write;

/// Pixels of a panel with its labels, and of the frame in it.
const PANEL: (f64, f64) = (480.0, 360.0);
const LEFT: f64 = 62.0;
const RIGHT: f64 = 460.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 310.0;

/// Colours that stay apart for colour-blind eyes (Okabe and Ito 2008).
const COLOURS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];

/// A chart of some lines.
#[derive(Debug, Clone)]
pub struct Panel<'a> {
    /// What the vertical axis shows, with its unit.
    pub title: &'a str,
    /// What the horizontal one shows.
    pub below: &'a str,
    /// Names and points, which rise along x; those that are not positive are left out.
    pub lines: Vec<(&'a str, Vec<(f64, f64)>)>,
}

/// Panels in a row.
const ACROSS: usize = 4;

/// Returns the panels side by side, in rows of four; names and titles are written as they are, so they hold nothing
/// that means something in XML.
#[must_use]
pub fn side_by_side(panels: &[Panel]) -> String {
    let rows = panels.len().div_ceil(ACROSS);
    let (width, height) = (PANEL.0 * panels.len().min(ACROSS) as f64, PANEL.1 * rows as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    for (number, panel) in panels.iter().enumerate() {
        let (column, row) = (number % ACROSS, number / ACROSS);
        let (x, y) = (PANEL.0 * column as f64, PANEL.1 * row as f64);
        let _ = writeln!(svg, "<g transform=\"translate({x} {y})\">");
        panel.draw(&mut svg);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// From the first to the last decade of some values, on pixels.
struct Axis {
    first: i32,
    last: i32,
    start: f64,
    end: f64,
}

impl Axis {
    fn around(values: impl Iterator<Item = f64>, start: f64, end: f64) -> Self {
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        #[expect(clippy::cast_possible_truncation, reason = "logarithms of numbers of 64 bits")]
        let [first, last] = [low.log10().floor() as i32, high.log10().ceil() as i32];
        Self { first, last: last.max(first + 1), start, end }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value.log10() - f64::from(self.first)) / f64::from(self.last - self.first);
        self.start + share * (self.end - self.start)
    }

    /// Whole decades.
    fn ticks(&self) -> impl Iterator<Item = (i32, f64)> {
        (self.first..=self.last).map(|decade| (decade, self.place(10_f64.powi(decade))))
    }
}

impl Panel<'_> {
    fn draw(&self, svg: &mut String) {
        let is_shown = |point: &&(f64, f64)| point.0 > 0.0 && point.1 > 0.0;
        let points = || self.lines.iter().flat_map(|line| line.1.iter().filter(is_shown));
        let x = Axis::around(points().map(|point| point.0), LEFT, RIGHT);
        let y = Axis::around(points().map(|point| point.1), BOTTOM, TOP);
        for (decade, at) in x.ticks() {
            let _ = writeln!(svg, "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"#cccccc\"/>");
            power(svg, (at, BOTTOM + 18.0), "middle", decade);
        }
        for (decade, at) in y.ticks() {
            let _ = writeln!(svg, "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"#cccccc\"/>");
            power(svg, (LEFT - 8.0, at + 4.0), "end", decade);
        }
        text(svg, (LEFT, TOP - 14.0), "start", self.title);
        text(svg, ((LEFT + RIGHT) / 2.0, BOTTOM + 38.0), "middle", self.below);
        for (number, (name, points)) in self.lines.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            let places: Vec<(f64, f64)> =
                points.iter().filter(is_shown).map(|point| (x.place(point.0), y.place(point.1))).collect();
            let words: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                words.join(" ")
            );
            for (x, y) in &places {
                let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{colour}\"/>");
            }
            let at = TOP + 16.0 + 18.0 * number as f64;
            let _ =
                writeln!(svg, "<path d=\"M{} {}h22\" stroke=\"{colour}\" stroke-width=\"2\"/>", LEFT + 10.0, at - 4.0);
            text(svg, (LEFT + 38.0, at), "start", name);
        }
    }
}

/// 10 with its exponent above the line.
fn power(svg: &mut String, place: (f64, f64), anchor: &str, decade: i32) {
    text(svg, place, anchor, &format!("10<tspan dy=\"-5\" font-size=\"9\">{decade}</tspan>"));
}

fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, words: &str) {
    let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decade_is_as_long_as_the_next() {
        let axis = Axis::around([0.02, 3.0].into_iter(), 0.0, 300.0);
        let ticks: Vec<(i32, f64)> = axis.ticks().collect();
        assert_eq!(ticks, [(-2, 0.0), (-1, 100.0), (0, 200.0), (1, 300.0)], "whole decades around the values");
        assert!((axis.place(0.02) - 30.103).abs() < 1e-3, "log 2 of a decade: {}", axis.place(0.02));
    }

    #[test]
    fn each_line_is_drawn_with_its_points_and_its_name() {
        let lines = vec![("build", vec![(1.0, 2.0), (10.0, 30.0)]), ("render", vec![(1.0, 5.0), (10.0, 6.0)])];
        let svg = side_by_side(&[Panel { title: "seconds", below: "triangles", lines }]);
        assert_eq!(svg.matches("<polyline").count(), 2, "lines");
        assert_eq!(svg.matches("<circle").count(), 4, "points");
        assert!(svg.contains(">build</text>") && svg.contains(">render</text>"), "names");
    }

    #[test]
    fn a_fifth_panel_stands_below_the_first() {
        let panel = Panel { title: "a", below: "b", lines: vec![("line", vec![(1.0, 2.0), (10.0, 30.0)])] };
        let svg = side_by_side(&vec![panel; 5]);
        assert!(svg.contains("width=\"1920\" height=\"720\""), "two rows of four");
        assert!(svg.contains("translate(1440 0)") && svg.contains("translate(0 360)"), "the fourth and the fifth");
    }
}

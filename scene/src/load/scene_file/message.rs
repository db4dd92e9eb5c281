//! Errors of the TOML reader in our words: one line that names the place, the field and the nearest known one.

use crate::load::error::{LoadError, Place, nearest, quoted};

/// What the TOML reader says of nesting: of values, and of keys with many dots.
const TOO_DEEP: [&str; 2] = ["cannot recurse further; max recursion depth met", "recursion limit"];

/// What it says of one thing in braces where there is a list of them.
const SINGLE: &str = "invalid type: map, expected a sequence";

/// What it says of numbers such as -.5.
const NO_DIGIT: &str = "invalid mantissa, expected digits";

/// What it says of a table that has one of several fields, such as the kinds of light.
const NO_KIND: &str = "wanted exactly 1 element, found 0 elements";
const KINDS: &str = "wanted exactly 1 element, more than 1 element";

/// Translates an error about `text`, which is the file at `place`.
pub(super) fn translate(error: &toml::de::Error, text: &str, place: Place<'_>) -> LoadError {
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    let place = Place::line(place.file, line_at(text, start));
    let message = error.message().replace('\n', ", ");
    let named = error.span().and_then(|span| text.get(span)).unwrap_or_default();
    if let Some((name, known)) = unknown(&message) {
        let advice = match nearest(name, known.iter().copied()) {
            Some(close) => format!("write '{close}'"),
            None => format!("known here are {}", known.join(", ")),
        };
        return place.invalid(format!("unknown field {}", quoted(name)), advice);
    }
    if TOO_DEEP.contains(&message.as_str()) {
        return place
            .too_large("nested too deep", "nest tables, lists and unions less than 80 deep, put unions side by side");
    }
    if message.contains("duplicate key") {
        return place.invalid(format!("duplicate key {}", quoted(named)), "keep one");
    }
    if let Some((written, wanted)) = brackets(&message, text, start) {
        return place.invalid(format!("{written} is the wrong kind of table"), format!("write {wanted}"));
    }
    // Our own types say what to do; the library does not.
    let (what, advice) = match message.as_str() {
        NO_DIGIT => ("a number without a digit before its point", "write 0.5 for .5"),
        NO_KIND => ("nothing says of which kind it is", "write one of the kinds of docs/scene-format.md"),
        KINDS => ("more than one kind", "keep one, and write others apart"),
        SINGLE => ("one where a list is wanted", "write it in brackets, for there may be several"),
        message => message.split_once("; ").unwrap_or((message, "see docs/scene-format.md for what is allowed")),
    };
    match field_at(text, start) {
        Some(field) => place.invalid(format!("{field}: {what}"), advice),
        None => place.invalid(what, advice),
    }
}

/// The header of a table in the line of the byte `start`, and the same with as many brackets as it should have: where a
/// table is in the place of a list of tables, or such a list in that of a table, whose fields it then seems to give in
/// order.
fn brackets(message: &str, text: &str, start: usize) -> Option<(String, String)> {
    let line = text.lines().nth(line_at(text, start) - 1)?.trim_start();
    let name = |opening: &str, closing: &str| {
        let (name, _) = line.strip_prefix(opening)?.split_once(closing)?;
        Some(name.trim().to_owned())
    };
    let expected = message.strip_prefix("invalid type: map, expected ")?;
    if let Some(name) = name("[[", "]]") {
        return Some((format!("[[{name}]]"), format!("[{name}], for there is one at most")));
    }
    let name = name("[", "]").filter(|_| expected == "a sequence")?;
    Some((format!("[{name}]"), format!("[[{name}]], for there may be several")))
}

/// The number of the line, from 1, that holds the byte `start`.
fn line_at(text: &str, start: usize) -> usize {
    text.as_bytes()[..start.min(text.len())].iter().filter(|&&byte| byte == b'\n').count() + 1
}

/// The unknown name and the known ones, from serde's messages for structs and enums and toml's for variants.
fn unknown(message: &str) -> Option<(&str, Vec<&str>)> {
    if let Some(rest) = message.strip_prefix("unexpected keys in table: ") {
        let (found, known) = rest.split_once(", available keys: ")?;
        return Some((found.split(", ").next()?, known.split(", ").collect()));
    }
    let rest = message.strip_prefix("unknown field `").or_else(|| message.strip_prefix("unknown variant `"))?;
    // Names are between backticks: the first, then every other piece.
    let mut pieces = rest.split('`');
    let name = pieces.next()?;
    Some((name, pieces.skip(1).step_by(2).collect()))
}

/// The key before the value at `start`, on the same line.
fn field_at(text: &str, start: usize) -> Option<&str> {
    let line = &text.get(..start)?[text[..start].rfind('\n').map_or(0, |end| end + 1)..];
    let (before, _) = line.rsplit_once('=')?;
    let key = before.trim_end().rsplit(|c: char| !(c.is_alphanumeric() || c == '_' || c == '-')).next()?;
    (!key.is_empty()).then_some(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_messages() {
        let known = vec!["eye", "at", "fov"];
        assert_eq!(
            unknown("unknown field `fovv`, expected one of `eye`, `at`, `fov`"),
            Some(("fovv", known.clone())),
            "struct"
        );
        assert_eq!(
            unknown("unexpected keys in table: fovv, x, available keys: eye, at, fov"),
            Some(("fovv", known)),
            "variant"
        );
        assert_eq!(unknown("unknown field `b`, expected `a`"), Some(("b", vec!["a"])), "one field");
        assert_eq!(unknown("missing field `a`"), None, "another message");
    }

    #[test]
    fn kinds_are_one_of_several() {
        #[derive(Debug, serde::Deserialize)]
        struct Root {
            #[expect(dead_code, reason = "for its errors")]
            light: Vec<crate::load::scene_file::schema::LightTable>,
        }
        let of = |text: &str| {
            let error = toml::from_str::<Root>(text).expect_err("no light");
            translate(&error, text, Place::file(std::path::Path::new("a.toml"))).to_string()
        };
        let none = "a.toml:2: nothing says of which kind it is; write one of the kinds of docs/scene-format.md";
        assert_eq!(of("\n[[light]]\n"), none);
        let point = "point = { position = [0, 0, 0], intensity = 1 }";
        let both = format!("[[light]]\n{point}\ndirectional = {{ direction = [0, 0, 1], irradiance = 1 }}\n");
        assert_eq!(of(&both), "a.toml:1: more than one kind; keep one, and write others apart");
    }

    #[test]
    fn brackets_are_counted() {
        let text = "version = 1\n[mesh]\n[[camera]]\na = 1";
        let at = |words| text.find(words).unwrap();
        let of = |written: &str, wanted: &str| Some((written.to_owned(), wanted.to_owned()));
        let sequence = "invalid type: map, expected a sequence";
        assert_eq!(brackets(sequence, text, at("[mesh]")), of("[mesh]", "[[mesh]], for there may be several"), "few");
        let number = "invalid type: map, expected a number";
        assert_eq!(brackets(number, text, at("[[")), of("[[camera]]", "[camera], for there is one at most"), "many");
        assert_eq!(brackets(number, text, at("[mesh]")), None, "a table where a number should be");
        assert_eq!(brackets("missing field `a`", text, at("[[")), None, "another message");
        assert_eq!(brackets(sequence, text, at("a = 1")), None, "a value");
    }

    #[test]
    fn fields_are_found_before_their_values() {
        let text = "[camera]\neye = [1, 2]\nq = { sphere = { radius = -1 } }";
        assert_eq!(field_at(text, text.find("[1").unwrap()), Some("eye"), "a list");
        assert_eq!(field_at(text, text.find("-1").unwrap()), Some("radius"), "in a table");
        assert_eq!(field_at(text, 0), None, "a table");
        assert_eq!(line_at(text, text.find("-1").unwrap()), 3, "third line");
    }
}

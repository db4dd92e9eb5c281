//! The reader between an OBJ file and tobj. It passes on vertices and faces in the plainest form, a line at a time, and
//! keeps what tobj would lose: line numbers, the material of each face, and which corners have normals and texture
//! coordinates (tobj fills gaps with the corner before).

use std::collections::{HashMap, HashSet};
use std::io::{self, BufRead, Read};

use super::error::{LoadError, Place, quoted};
use super::files::check_name;
use super::limits;
use super::lines::{Lines, uncommented};

/// What a face is made of besides its positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Face {
    /// Line of the file.
    pub(super) line: u32,
    /// Index into [`ObjReader::names`].
    pub(super) material: u32,
    pub(super) has_uvs: bool,
    pub(super) has_normals: bool,
}

/// Reads OBJ text for tobj; what it has learnt is in its fields afterwards.
pub(super) struct ObjReader<'a> {
    lines: Lines<'a>,
    /// The line handed out at present, and how much of it is taken.
    out: String,
    taken: usize,
    /// What ended the reading, where it was not the end of the file.
    pub(super) error: Option<LoadError>,
    /// One for each face handed out.
    pub(super) faces: Vec<Face>,
    /// Names after `usemtl`, the first of which stands for none.
    pub(super) names: Vec<String>,
    name_index: HashMap<String, u32>,
    material: u32,
    /// Different names after `mtllib`, each with its first line.
    pub(super) libraries: Vec<(String, usize)>,
    library_names: HashSet<String>,
    /// Triangles that the faces will make.
    triangles: usize,
    /// Faces of one or two corners, points and lines that were left out.
    pub(super) skipped: usize,
    /// Keywords left out that would change the picture, such as those of curved surfaces.
    pub(super) unknown: usize,
    positions: Counted,
    uvs: Counted,
    normals: Counted,
}

/// How many there are of something, and the largest index that asks for one, with its line.
#[derive(Debug, Default)]
struct Counted {
    count: usize,
    asked: usize,
    line: usize,
}

impl<'a> ObjReader<'a> {
    pub(super) fn new(lines: Lines<'a>) -> Self {
        Self {
            lines,
            out: String::new(),
            taken: 0,
            error: None,
            faces: Vec::new(),
            names: vec![String::new()],
            name_index: HashMap::new(),
            material: 0,
            libraries: Vec::new(),
            library_names: HashSet::new(),
            triangles: 0,
            skipped: 0,
            unknown: 0,
            positions: Counted::default(),
            uvs: Counted::default(),
            normals: Counted::default(),
        }
    }

    /// The place of the line read last.
    pub(super) fn place(&self) -> Place<'a> {
        self.lines.place()
    }

    /// Checks, after the last line, that all indices point at something: they may point ahead.
    ///
    /// Files whose faces name normals of which there is not one are common; those faces are flat.
    pub(super) fn check_indices(&self) -> Result<(), LoadError> {
        for (counted, kind) in
            [(&self.positions, "vertex"), (&self.uvs, "texture coordinate"), (&self.normals, "normal")]
        {
            let none_at_all = kind == "normal" && counted.count == 0;
            if counted.asked > counted.count && !none_at_all {
                let what = format!("{kind} index {} is out of range, the file has {}", counted.asked, counted.count);
                return Err(Place::line(self.place().file, counted.line).invalid(what, "correct the index"));
            }
        }
        Ok(())
    }

    /// Prepares the next line for tobj; an empty one at the end of the file.
    fn advance(&mut self) -> Result<(), LoadError> {
        self.out.clear();
        self.taken = 0;
        while self.out.is_empty() {
            let Some(line) = self.lines.next()? else { return Ok(()) };
            let line = line.trim();
            let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
            match key {
                "v" | "vt" | "vn" => {
                    // Borrowed text and own fields do not mix: the numbers are copied first.
                    self.out.push_str(key);
                    let found = numbers(rest, if key == "vt" { 2 } else { 3 }, &mut self.out);
                    found.map_err(|what| self.place().invalid(what, "give finite numbers of ordinary size"))?;
                    self.out.push('\n');
                    let counted = match self.out.as_bytes()[1] {
                        b't' => &mut self.uvs,
                        b'n' => &mut self.normals,
                        _ => &mut self.positions,
                    };
                    counted.count += 1;
                }
                "f" => {
                    self.out.push_str("f ");
                    self.out.push_str(uncommented(rest));
                    self.out.push('\n');
                    if !self.face()? {
                        self.out.clear();
                    }
                }
                "usemtl" => {
                    let name = rest.trim().to_owned();
                    self.use_material(name)?;
                }
                "mtllib" => {
                    let name = rest.trim().to_owned();
                    self.add_library(name)?;
                }
                "l" | "p" => self.skipped += 1,
                "o" | "g" | "s" | "" => {}
                _ if key.starts_with('#') => {}
                _ => self.unknown += 1,
            }
        }
        Ok(())
    }

    fn add_library(&mut self, name: String) -> Result<(), LoadError> {
        let place = self.place();
        check_name(&name, place)?;
        if self.library_names.insert(name.clone()) {
            if self.libraries.len() >= limits::INCLUDES {
                let what = format!("more than {} material libraries", limits::INCLUDES);
                return Err(place.too_large(what, "join them"));
            }
            self.libraries.push((name, place.line.unwrap_or_default()));
        }
        Ok(())
    }

    fn use_material(&mut self, name: String) -> Result<(), LoadError> {
        check_name(&name, self.place())?;
        self.material = match self.name_index.get(&name) {
            Some(&index) => index,
            None if self.names.len() >= limits::MATERIALS => {
                let what = format!("more than {} materials", limits::MATERIALS);
                return Err(self.place().too_large(what, "use fewer"));
            }
            None => {
                let index = as_u32(self.names.len());
                self.names.push(name.clone());
                self.name_index.insert(name, index);
                index
            }
        };
        Ok(())
    }

    /// Looks through the face in `out`; returns whether it is one.
    fn face(&mut self) -> Result<bool, LoadError> {
        let place = self.lines.place();
        let line = place.line.unwrap_or_default();
        let mut corners = 0;
        let (mut has_uvs, mut has_normals) = (true, true);
        for corner in self.out[1..].split_ascii_whitespace() {
            corners += 1;
            let mut parts = corner.split('/');
            let (v, vt, vn) =
                (parts.next().unwrap_or_default(), parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
            if parts.next().is_some() {
                return Err(place.invalid(
                    format!("{} has more than three indices", quoted(corner)),
                    "write vertex/texture/normal",
                ));
            }
            self.positions.ask(v, "vertex", place)?;
            has_uvs &= !vt.is_empty();
            has_normals &= !vn.is_empty();
            if !vt.is_empty() {
                self.uvs.ask(vt, "texture coordinate", place)?;
            }
            if !vn.is_empty() {
                self.normals.ask(vn, "normal", place)?;
            }
        }
        if corners < 3 {
            self.skipped += 1;
            return Ok(false);
        }
        if corners > limits::CORNERS {
            let what = format!("a polygon of {corners} corners, more than the limit of {}", limits::CORNERS);
            return Err(place.too_large(what, "split it"));
        }
        self.triangles += corners - 2;
        if self.triangles > limits::TRIANGLES {
            return Err(place.too_large(format!("more than {} triangles", limits::TRIANGLES), "use a coarser mesh"));
        }
        self.faces.push(Face { line: as_u32(line), material: self.material, has_uvs, has_normals });
        Ok(true)
    }
}

impl Counted {
    /// Checks an index from a face: 1 is the first, -1 the last so far.
    fn ask(&mut self, text: &str, kind: &str, place: Place<'_>) -> Result<(), LoadError> {
        let advice = "indices count from 1, or from -1 backwards";
        let index: i64 =
            text.parse().map_err(|_| place.invalid(format!("{} is not a {kind} index", quoted(text)), advice))?;
        if index == 0 {
            return Err(place.invalid(format!("{kind} index 0"), advice));
        }
        if index < 0 && index.unsigned_abs() > self.count as u64 {
            let what = format!("{kind} index {index} lies before the start, there are {} so far", self.count);
            return Err(place.invalid(what, advice));
        }
        // 32 bits are enough for every file within the limits, and spare the arithmetic behind from overflow.
        if index > i64::from(i32::MAX) {
            return Err(place.invalid(format!("{kind} index {index} is out of range"), advice));
        }
        let asked = usize::try_from(index).unwrap_or(0);
        if asked > self.asked {
            (self.asked, self.line) = (asked, place.line.unwrap_or_default());
        }
        Ok(())
    }
}

/// Copies the first `wanted` numbers of a line to `out` after checking them; what follows (weights, colours) is left
/// out.
fn numbers(text: &str, wanted: usize, out: &mut String) -> Result<(), String> {
    let mut found = 0;
    for word in uncommented(text).split_ascii_whitespace().take(wanted) {
        if !is_plain(word) {
            let value: f64 = word.parse().map_err(|_| format!("{} is not a number", quoted(word)))?;
            if !value.is_finite() {
                return Err(format!("{} is not a finite number", quoted(word)));
            }
            if value.abs() > limits::COORDINATE {
                return Err(format!("{} is beyond the limit of {:e}", quoted(word), limits::COORDINATE));
            }
        }
        out.push(' ');
        out.push_str(word);
        found += 1;
    }
    match (found, wanted) {
        // A texture of one dimension.
        (1, 2) => out.push_str(" 0"),
        _ if found < wanted => return Err(format!("{found} numbers where {wanted} are needed")),
        _ => {}
    }
    Ok(())
}

/// Whether a word is surely a number of ordinary size: at most nine digits before the point and no exponent.
fn is_plain(word: &str) -> bool {
    let digits = word.strip_prefix('-').unwrap_or(word);
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    (1..=9).contains(&whole.len()) && whole.bytes().chain(fraction.bytes()).all(|byte| byte.is_ascii_digit())
}

fn as_u32(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

impl Read for ObjReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for ObjReader<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken == self.out.len()
            && let Err(error) = self.advance()
        {
            self.error = Some(error);
            return Err(io::ErrorKind::InvalidData.into());
        }
        Ok(&self.out.as_bytes()[self.taken..])
    }

    fn consume(&mut self, count: usize) {
        self.taken += count;
    }
}

//! Solids as text, and back: every number is written so that it is read to the same bits.
//!
//! ```text
//! solid       = form | operation "(" [psi ","] solid {"," solid} ")"
//! operation   = "union" | "intersection" | "difference" | "complement"
//! psi         = "maximum" | "r_function" | "blend" number
//! form        = "form" "(" ["origin" 3 numbers ","] "base" 10 numbers {"," "perturbation" factor 10 numbers} ")"
//! ```
//!
//! The reader keeps a list of what is open in place of calls of itself, and refuses more than the depth limit.

use std::fmt::{self, Write};
use std::str::FromStr;

use glam::DVec3;

use crate::{
    DEPTH_LIMIT, FormError, FreeForm, Operation, Perturbation, Psi, Quadric, Solid,
    tree::{Join, Place, Token},
};

/// Says where and why a text is no solid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct TextError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

impl fmt::Display for Solid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Parts that are still to come, for each operation that is open.
        let mut open: Vec<u32> = Vec::new();
        let mut place = Place::default();
        loop {
            let form = place.form;
            match place.next(&self.tokens) {
                Token::Form => {
                    indent(f, open.len())?;
                    self.forms[form].fmt(f)?;
                }
                Token::Join(Join { operation, psi, parts, .. }) => {
                    indent(f, open.len())?;
                    write!(f, "{}(", operation.name())?;
                    match psi {
                        _ if operation == Operation::Complement => {}
                        Psi::Maximum => {}
                        Psi::RFunction => f.write_str("r_function,")?,
                        Psi::Blend { width } => write!(f, "blend {width},")?,
                    }
                    f.write_char('\n')?;
                    open.push(parts);
                    continue;
                }
            }
            // The form may have been the last part of several operations.
            while let Some(parts) = open.last_mut() {
                *parts -= 1;
                if *parts > 0 {
                    f.write_str(",\n")?;
                    break;
                }
                open.pop();
                f.write_char('\n')?;
                indent(f, open.len())?;
                f.write_char(')')?;
            }
            if open.is_empty() {
                return Ok(());
            }
        }
    }
}

fn indent(f: &mut fmt::Formatter<'_>, level: usize) -> fmt::Result {
    (0..level).try_for_each(|_| f.write_str("  "))
}

impl fmt::Display for FreeForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers =
            |f: &mut fmt::Formatter<'_>, numbers: &[f64]| numbers.iter().try_for_each(|number| write!(f, " {number}"));
        f.write_str("form(")?;
        if self.origin() != DVec3::ZERO {
            f.write_str("origin")?;
            numbers(f, &self.origin().to_array())?;
            f.write_str(", ")?;
        }
        f.write_str("base")?;
        numbers(f, &self.base().coefficients)?;
        for Perturbation { quadric, factor } in self.perturbations() {
            write!(f, ", perturbation {factor}")?;
            numbers(f, &quadric.coefficients)?;
        }
        f.write_char(')')
    }
}

impl FromStr for Solid {
    type Err = TextError;

    fn from_str(text: &str) -> Result<Self, TextError> {
        let mut words = Words { text, rest: text };
        let mut open: Vec<Open> = Vec::new();
        loop {
            let word = words.word()?;
            words.take('(')?;
            let operation = match word {
                "form" => None,
                "union" => Some(Operation::Union),
                "intersection" => Some(Operation::Intersection),
                "difference" => Some(Operation::Difference),
                "complement" => Some(Operation::Complement),
                _ => return Err(words.error(format!("'{word}' where a form or a set operation is needed"))),
            };
            if let Some(operation) = operation {
                if open.len() == DEPTH_LIMIT {
                    return Err(words.error(FormError::TooDeep.to_string()));
                }
                open.push(Open { operation, psi: words.psi()?, parts: Vec::new() });
                continue;
            }
            let mut solid = Self::from(words.form()?);
            // What is complete is a part of what is open.
            loop {
                let Some(last) = open.last_mut() else {
                    words.skip_space();
                    return if words.rest.is_empty() {
                        Ok(solid)
                    } else {
                        Err(words.error("text after the solid".to_owned()))
                    };
                };
                last.parts.push(solid);
                if words.take_if(',') {
                    break;
                }
                words.take(')')?;
                let Some(Open { operation, psi, parts }) = open.pop() else { break };
                solid = Self::join(operation, psi, parts).map_err(|error| words.error(error.to_string()))?;
            }
        }
    }
}

/// An operation whose parts are being read.
struct Open {
    operation: Operation,
    psi: Psi,
    parts: Vec<Solid>,
}

/// What is left of a text.
struct Words<'a> {
    text: &'a str,
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn error(&self, what: String) -> TextError {
        let read = &self.text[..self.text.len() - self.rest.len()];
        TextError { line: read.matches('\n').count() + 1, what }
    }

    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take_if(&mut self, sign: char) -> bool {
        self.skip_space();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn take(&mut self, sign: char) -> Result<(), TextError> {
        if self.take_if(sign) { Ok(()) } else { Err(self.error(format!("'{sign}' is missing"))) }
    }

    /// Returns the next word or number without stepping over it.
    fn peek(&mut self) -> &'a str {
        self.skip_space();
        let end = self.rest.find(|c: char| c.is_whitespace() || "(),".contains(c)).unwrap_or(self.rest.len());
        &self.rest[..end]
    }

    fn word(&mut self) -> Result<&'a str, TextError> {
        let word = self.peek();
        if word.is_empty() {
            let found = self.rest.chars().next().map_or("the text ends".to_owned(), |sign| format!("'{sign}'"));
            return Err(self.error(format!("{found} where a word or a number is needed")));
        }
        self.rest = &self.rest[word.len()..];
        Ok(word)
    }

    fn number(&mut self) -> Result<f64, TextError> {
        let word = self.word()?;
        word.parse().map_err(|_| self.error(format!("'{word}' is not a number")))
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], TextError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Ok(numbers)
    }

    fn psi(&mut self) -> Result<Psi, TextError> {
        let psi = match self.peek() {
            "maximum" => Psi::Maximum,
            "r_function" => Psi::RFunction,
            "blend" => Psi::Blend { width: 0.0 },
            _ => return Ok(Psi::Maximum),
        };
        self.word()?;
        let psi = if psi.blends() { Psi::Blend { width: self.number()? } } else { psi };
        self.take(',')?;
        Ok(psi)
    }

    /// Reads a form behind its bracket.
    fn form(&mut self) -> Result<FreeForm, TextError> {
        let origin = if self.peek() == "origin" {
            self.word()?;
            let origin = self.numbers()?;
            self.take(',')?;
            DVec3::from_array(origin)
        } else {
            DVec3::ZERO
        };
        if self.peek() != "base" {
            return Err(self.error("a form without a base".to_owned()));
        }
        self.word()?;
        let base = self.quadric()?;
        let mut perturbations = Vec::new();
        while self.take_if(',') {
            let word = self.word()?;
            if word != "perturbation" {
                return Err(self.error(format!("'{word}' where a perturbation is needed")));
            }
            let factor = self.number()?;
            perturbations.push(Perturbation { quadric: self.quadric()?, factor });
        }
        self.take(')')?;
        FreeForm::with_origin(origin, base, perturbations).map_err(|error| self.error(error.to_string()))
    }

    fn quadric(&mut self) -> Result<Quadric, TextError> {
        let coefficients = self.numbers()?;
        Quadric::new(coefficients).map_err(|error| self.error(error.to_string()))
    }
}

//! Numbers of a scene file, each type with its domain: what is out of it is refused where it stands.
//!
//! The texts read `what; do this`, as [`super::message`] expects.

use std::fmt;

use glam::{DVec3, UVec2, Vec2, Vec3};
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};

use crate::Noise;
use crate::load::limits;

/// One number, or several in brackets.
struct Numbers(Vec<f64>);

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = Numbers;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a list of numbers")
            }

            fn visit_i64<E>(self, number: i64) -> Result<Numbers, E> {
                Ok(Numbers(vec![number as f64]))
            }

            fn visit_f64<E>(self, number: f64) -> Result<Numbers, E> {
                Ok(Numbers(vec![number]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers, A::Error> {
                let mut numbers = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                Ok(Numbers(numbers))
            }
        }
        deserializer.deserialize_any(Reader)
    }
}

impl Numbers {
    /// `N` numbers, all in `[least, most]`.
    fn array<const N: usize>(self, least: f64, most: f64) -> Result<[f64; N], String> {
        let count = self.0.len();
        let array: [f64; N] =
            self.0.try_into().map_err(|_| format!("{count} numbers where {N} are needed; give {N}"))?;
        match array.iter().position(|x| !(least..=most).contains(x)) {
            None => Ok(array),
            Some(i) => {
                let which = if N == 1 { String::new() } else { format!(" at index {i}") };
                Err(format!("{}{which} is out of range; {}", array[i], range(least, most)))
            }
        }
    }

    /// Three numbers, or one for all three.
    fn triple(self, least: f64, most: f64) -> Result<DVec3, String> {
        if self.0.len() == 1 {
            return self.array::<1>(least, most).map(|[grey]| DVec3::splat(grey));
        }
        self.array::<3>(least, most).map(DVec3::from_array)
    }
}

fn range(least: f64, most: f64) -> String {
    const HUGE: f64 = f32::MAX as f64;
    match (least, most) {
        _ if least == -HUGE && most == HUGE => "give a finite number".to_owned(),
        (_, HUGE) => format!("give a finite number of at least {least:?}"),
        _ => format!("give numbers from {least:?} to {most:?}"),
    }
}

/// A number in the precision that scenes have; the bounds above keep it finite.
#[expect(clippy::cast_possible_truncation, reason = "rounding to the nearest is meant")]
fn single(x: f64) -> f32 {
    x as f32
}

/// Declares a type that is read from [`Numbers`] by a function.
macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident($inner:ty) = $read:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
        #[serde(try_from = "Numbers")]
        pub(super) struct $name(pub(super) $inner);

        impl TryFrom<Numbers> for $name {
            type Error = String;

            fn try_from(numbers: Numbers) -> Result<Self, String> {
                let read: fn(Numbers) -> Result<$inner, String> = $read;
                read(numbers).map(Self)
            }
        }
    )*};
}

/// Largest number of single precision.
const MOST: f64 = f32::MAX as f64;

numbers! {
    /// A point or a vector, metres.
    Point(DVec3) = |n| n.array::<3>(-limits::COORDINATE, limits::COORDINATE).map(DVec3::from_array);
    /// A direction of any length but zero.
    Direction(DVec3) = |n| {
        let direction = n.array::<3>(-limits::COORDINATE, limits::COORDINATE).map(DVec3::from_array)?;
        direction.try_normalize().ok_or_else(|| "a direction of length zero; give one that points somewhere".to_owned())
    };
    /// Texture coordinates.
    Uv(Vec2) = |n| n.array::<2>(-limits::COORDINATE, limits::COORDINATE).map(|[u, v]| Vec2::new(single(u), single(v)));
    /// Three radii.
    Radii(DVec3) = |n| n.triple(1e-9, limits::COORDINATE);
    /// A factor for each axis; negative ones mirror.
    Scale(DVec3) = |n| {
        let scale = n.triple(-1e6, 1e6)?;
        if scale.abs().min_element() < 1e-6 { Err("the scale is zero or nearly; give factors from 1e-6 to 1e6".to_owned()) } else { Ok(scale) }
    };
    /// Angles about x, y and z, degrees.
    Angles(DVec3) = |n| n.array::<3>(-3600.0, 3600.0).map(DVec3::from_array);
    /// Numbers of copies along x, y and z.
    Counts([u32; 3]) = counts;
    /// The least and the largest of random factors.
    Sizes([f64; 2]) = |n| {
        let [least, most] = n.array::<2>(1e-6, 1e6)?;
        if least <= most { Ok([least, most]) } else { Err(format!("from {least} to {most}; give the smaller one first")) }
    };
    /// Shares of light, linear RGB.
    Share(Vec3) = |n| n.triple(0.0, 1.0).map(|v| v.as_vec3());
    /// Light, linear RGB, or an absorption coefficient.
    Amount(Vec3) = |n| n.triple(0.0, MOST).map(|v| v.as_vec3());
    /// A share that has no colour.
    Fraction(f32) = |n| n.array::<1>(0.0, 1.0).map(|[x]| single(x));
    /// Sizes of noise, metres.
    NoiseSize(Vec3) = |n| n.triple(1e-6, limits::COORDINATE).map(|v| v.as_vec3());
    /// Octaves of noise.
    Octaves(u32) = |n| n.array::<1>(1.0, f64::from(Noise::MAX_OCTAVES)).and_then(|[octaves]| whole(octaves).map_err(|error| format!("{error}; give a number of octaves")));
    /// How far noise moves sheets and rings.
    Distortion(f32) = |n| n.array::<1>(0.0, 1000.0).map(|[x]| single(x));
    /// A microfacet width.
    Alpha(f32) = |n| n.array::<1>(1e-3, 1.0).map(|[x]| single(x));
    /// A refractive index.
    Index(f32) = |n| n.array::<1>(0.1, 10.0).map(|[x]| single(x));
    /// An angle of view, degrees.
    FieldOfView(f32) = |n| n.array::<1>(0.01, 179.0).map(|[x]| single(x));
    /// A factor for light.
    Factor(f32) = |n| n.array::<1>(0.0, 1e30).map(|[x]| single(x));
    /// An exposure, in stops.
    Exposure(f32) = |n| n.array::<1>(-64.0, 64.0).map(|[x]| single(x));
    /// A quality.
    Quality(f32) = |n| n.array::<1>(1e-3, 1e3).map(|[x]| single(x));
    /// Samples a pixel.
    Spp(u32) = spp;
    /// Any finite number.
    Real(f64) = |n| n.array::<1>(-MOST, MOST).map(|[x]| x);
    /// A length, metres.
    Length(f64) = |n| n.array::<1>(1e-9, limits::COORDINATE).map(|[x]| x);
    /// The ten coefficients of a quadric.
    Coefficients([f64; 10]) = |n| n.array::<10>(-MOST, MOST);
    /// The size of a film, pixels.
    FilmSize(UVec2) = film_size;
}

fn counts(numbers: Numbers) -> Result<[u32; 3], String> {
    let [x, y, z] = numbers.array::<3>(1.0, limits::COPIES as f64)?;
    let count = |n| whole(n).map_err(|error| format!("{error}; give numbers of copies"));
    Ok([count(x)?, count(y)?, count(z)?])
}

fn spp(numbers: Numbers) -> Result<u32, String> {
    let [spp] = numbers.array::<1>(1.0, f64::from(limits::SPP))?;
    whole(spp).map_err(|error| format!("{error}; give samples a pixel"))
}

fn film_size(numbers: Numbers) -> Result<UVec2, String> {
    let [width, height] = numbers.array::<2>(1.0, f64::from(limits::FILM_SIDE))?;
    let side = |side| whole(side).map_err(|error| format!("{error}; give pixels"));
    let size = UVec2::new(side(width)?, side(height)?);
    let pixels = u64::from(size.x) * u64::from(size.y);
    if pixels > limits::PIXELS {
        return Err(format!("{pixels} pixels, more than the limit of {}; make the film smaller", limits::PIXELS));
    }
    Ok(size)
}

/// A number that has no fraction and is known to fit.
fn whole(x: f64) -> Result<u32, String> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "callers bound the number")]
    if x.fract() == 0.0 { Ok(x as u32) } else { Err(format!("{x} is not a whole number")) }
}

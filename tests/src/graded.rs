//! Scenes that are hard by one number each, and what every point of their pictures sends to the eye in closed form.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scene::{Material, Scene};

use crate::{Builder, black, lambert, lamp, sphere_irradiance};

/// A scene, and the radiance that a point in it sends to the eye, W m^-2 sr^-1.
pub struct Graded {
    /// The scene; its camera shows nothing but points whose radiance is known.
    pub scene: Scene,
    /// Red, as a function of the point.
    pub known: Box<dyn Fn(DVec3) -> f64>,
}

impl std::fmt::Debug for Graded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Graded").field("scene", &self.scene).finish_non_exhaustive()
    }
}

impl Graded {
    fn new(builder: Builder, known: impl Fn(DVec3) -> f64 + 'static) -> Self {
        Self { scene: builder.build(), known: Box::new(known) }
    }
}

/// Returns two half-planes of `albedo` that meet in the y axis at an angle of `degrees` and end at `end`, under a sky
/// of 1, seen from inside at `distance` from the seam and `elevation` degrees over one of them.
///
/// E = pi (1 - cos phi) / 2 / (1 - rho (1 + cos phi) / 2) at every distance d from the seam. That the planes end makes
/// d / (2 `end`) of it wrong.
#[must_use]
pub fn wedge(degrees: f32, albedo: f32, end: f32, distance: f32, elevation: f32) -> Graded {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let edge = [Vec3::new(0.0, end, 0.0), Vec3::new(0.0, -end, 0.0)];
    let other = Vec3::new(cos, 0.0, sin) * end;
    let at = Vec3::X * distance;
    // From the side and from behind, so that the other plane does not stand in the way.
    let (up, along) = elevation.to_radians().sin_cos();
    let towards_eye = Vec3::new(along * 0.5f32.sqrt(), along * 0.5f32.sqrt(), up) * 0.287;
    let builder = Builder::default()
        .polygon(&[edge[1], edge[1] + Vec3::X * end, edge[0] + Vec3::X * end, edge[0]], lambert(albedo))
        .polygon(&[edge[0], edge[0] + other, edge[1] + other, edge[1]], lambert(albedo))
        .sky(1.0)
        .view(at + towards_eye * distance, at, 30.0_f32.min(0.5 * elevation));
    let (cos, rho) = (f64::from(degrees).to_radians().cos(), f64::from(albedo));
    let irradiance = PI * (1.0 - cos) / 2.0 / (1.0 - rho * (1.0 + cos) / 2.0);
    Graded::new(builder, move |_| rho * irradiance / PI)
}

/// Returns a floor of albedo 0.5 under a black roof at `height`, open to a sky of 1 at x = 0, seen from inside, one
/// metre behind the opening.
///
/// E = pi (1 - d / sqrt(d^2 + h^2)) / 2 at the depth d.
#[must_use]
pub fn slit(height: f32) -> Graded {
    let end = 1e3;
    let floor = [(0.0, -end), (end, -end), (end, end), (0.0, end)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let roof = [(0.0, end), (end, end), (end, -end), (0.0, -end)].map(|(x, y)| Vec3::new(x, y, height));
    let builder = Builder::default().polygon(&floor, lambert(0.5)).polygon(&roof, black()).sky(1.0).view(
        Vec3::X + Vec3::new(0.2, 0.1, 0.8) * height,
        Vec3::X,
        4.0,
    );
    Graded::new(builder, move |p| 0.25 * (1.0 - p.x / p.x.hypot(f64::from(height))))
}

/// Returns a floor of albedo 0.5 half under a black half-plane at height 1 that hides x < 0 of a sky of 1, all moved by
/// `offset` along each axis.
///
/// E = pi (1 + x / sqrt(1 + x^2)) / 2.
#[must_use]
pub fn half_sky(offset: f32) -> Graded {
    let (end, origin) = (1e3, Vec3::splat(offset));
    let corners = [(-end, -end), (0.0, -end), (0.0, end), (-end, end)].map(|(x, y)| origin + Vec3::new(x, y, 1.0));
    let at = origin + Vec3::X * 0.1;
    let builder = Builder::default()
        .square(origin, Vec3::Z, end, lambert(0.5))
        .polygon(&corners, black())
        .sky(1.0)
        .view(at + Vec3::new(0.1, 0.2, 0.8), at, 8.0);
    let edge = f64::from(origin.x);
    Graded::new(builder, move |p| 0.25 * (1.0 + (p.x - edge) / (p.x - edge).hypot(1.0)))
}

/// Returns a white floor and a ball of `radius` that shines on it from a distance of 2, 45 degrees from the normal,
/// with a flux that does not depend on the radius.
///
/// E = cos 45 / 4 below the middle for every radius.
#[must_use]
pub fn ball_lamp(radius: f32) -> Graded {
    let centre = Vec3::new(1.0, 0.0, 1.0) * 2.0f32.sqrt();
    let radiance = 1.0 / (std::f32::consts::PI * radius * radius);
    let builder = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 0.05, lambert(1.0))
        .ball(centre, radius.into(), lamp(radiance))
        .view(Vec3::new(0.0, 0.3, 0.4), Vec3::ZERO, 5.0);
    let (centre, radius, radiance) = (centre.as_dvec3(), f64::from(radius), f64::from(radiance));
    Graded::new(builder, move |p| radiance * sphere_irradiance(centre, radius, p, DVec3::Z) / PI)
}

/// Returns the inside of a cube of walls of `albedo` that shine with radiance 1.
///
/// L = 1 / (1 - a) everywhere.
#[must_use]
pub fn glowing_room(albedo: f32) -> Graded {
    let wall = Material { diffuse: Vec3::splat(albedo), ..lamp(1.0) };
    let builder = Builder::default().cube_room(&wall).view(Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.4, -0.3, 0.5), 60.0);
    Graded::new(builder, move |_| 1.0 / (1.0 - f64::from(albedo)))
}

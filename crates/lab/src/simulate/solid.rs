//! What a lab is made of: upright boxes, cylinders and ellipsoids, and what covers them.

use super::texture::TextureId;
use super::vector::{Color, Vec3, vec3};

/// The geometry of a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Box,
    /// With a vertical axis.
    Cylinder,
    Ellipsoid,
}

/// How a texture lies on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mapping {
    /// Repeated every so many meters.
    Tiled(f32),
    /// Once over the whole face.
    Fitted,
    /// Infinitely far away: a panorama of the outside, seen through the surface.
    Outside,
}

/// How a surface looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Material {
    pub texture: TextureId,
    pub tint: Color,
    pub mapping: Mapping,
    /// The radiance that the texture's white gives off by itself.
    pub glow: f32,
}

/// A solid: a shape with half sizes `half` round `center`, turned about the vertical.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    pub shape: Shape,
    pub center: Vec3,
    pub half: Vec3,
    /// Cosine and sine of the yaw.
    pub turn: [f32; 2],
    /// Covers the side toward local +y.
    pub front: Material,
    pub rest: Material,
}

/// A point of a surface, for shading.
pub(super) struct SurfacePoint {
    pub normal: Vec3,
    pub material: Material,
    /// In repeats of the texture.
    pub uv: [f32; 2],
    /// Repeats of the texture a meter.
    pub repeats: f32,
}

/// Hits nearer than this are the surface that the ray starts from.
const NEAREST: f32 = 1e-4;

impl Solid {
    /// The distance along the ray to where it enters; infinite when it does not. A ray that starts
    /// inside does not enter.
    #[inline]
    pub fn entry(&self, origin: Vec3, direction: Vec3) -> f32 {
        let [cos, sin] = self.turn;
        let origin = (origin - self.center).turned(cos, -sin);
        let direction = direction.turned(cos, -sin);
        let entry = match self.shape {
            Shape::Box => {
                let [x, y, z] = [
                    slab(origin.x, direction.x, self.half.x),
                    slab(origin.y, direction.y, self.half.y),
                    slab(origin.z, direction.z, self.half.z),
                ];
                let enters = larger(larger(x[0], y[0]), z[0]);
                let leaves = smaller(smaller(x[1], y[1]), z[1]);
                if enters <= leaves { enters } else { f32::INFINITY }
            }
            Shape::Cylinder => {
                let [x, y] = [1.0 / self.half.x, 1.0 / self.half.y];
                let flat = |v: Vec3| vec3(v.x * x, v.y * y, 0.0);
                let round = unit_sphere(flat(origin), flat(direction));
                let z = slab(origin.z, direction.z, self.half.z);
                let (enters, leaves) = (larger(round[0], z[0]), smaller(round[1], z[1]));
                if enters <= leaves { enters } else { f32::INFINITY }
            }
            Shape::Ellipsoid => {
                let scale = vec3(1.0 / self.half.x, 1.0 / self.half.y, 1.0 / self.half.z);
                unit_sphere(origin * scale, direction * scale)[0]
            }
        };
        if entry > NEAREST { entry } else { f32::INFINITY }
    }

    /// What is at a point of the surface.
    #[inline]
    pub fn surface(&self, point: Vec3) -> SurfacePoint {
        let [cos, sin] = self.turn;
        let local = (point - self.center).turned(cos, -sin);
        let relative = vec3(local.x / self.half.x, local.y / self.half.y, local.z / self.half.z);
        let (normal, across) = match self.shape {
            Shape::Box => box_face(local, relative, self.half),
            Shape::Cylinder if relative.z.abs() > 0.999 => {
                (vec3(0.0, 0.0, relative.z.signum()), [[local.x, self.half.x], [local.y, self.half.y]])
            }
            Shape::Cylinder | Shape::Ellipsoid => {
                let slope = if self.shape == Shape::Cylinder { 0.0 } else { relative.z / self.half.z };
                let normal = vec3(relative.x / self.half.x, relative.y / self.half.y, slope).normalized();
                let half_turn = std::f32::consts::PI * self.half.x;
                let along = -relative.x.atan2(relative.y) * self.half.x;
                (normal, [[along, half_turn], [-local.z, self.half.z]])
            }
        };
        let is_front = normal.y > 0.9 && self.shape == Shape::Box;
        let material = if is_front { self.front } else { self.rest };
        let (uv, repeats) = match material.mapping {
            Mapping::Tiled(meters) => (across.map(|[at, _]| at / meters), 1.0 / meters),
            _ => (across.map(|[at, half]| 0.5 + 0.5 * at / half), 0.5 / across[0][1].min(across[1][1])),
        };
        SurfacePoint { normal: normal.turned(cos, sin), material, uv, repeats }
    }

    /// The rectangle of the floor below the solid: least x and y, greatest x and y.
    pub fn footprint(&self) -> [f32; 4] {
        let [cos, sin] = self.turn.map(f32::abs);
        let reach_x = cos * self.half.x + sin * self.half.y;
        let reach_y = sin * self.half.x + cos * self.half.y;
        let Vec3 { x, y, .. } = self.center;
        [x - reach_x, y - reach_y, x + reach_x, y + reach_y]
    }
}

/// The normal of the face that a point of a box lies on, and where on the face it is: for the texture's
/// two directions, the place and the half size. Textures read from left to right on the front.
fn box_face(local: Vec3, relative: Vec3, half: Vec3) -> (Vec3, [[f32; 2]; 2]) {
    let [x, y, z] = [relative.x.abs(), relative.y.abs(), relative.z.abs()];
    if z >= x && z >= y {
        (vec3(0.0, 0.0, relative.z.signum()), [[local.x, half.x], [local.y, half.y]])
    } else if y >= x {
        let sign = relative.y.signum();
        (vec3(0.0, sign, 0.0), [[-local.x * sign, half.x], [-local.z, half.z]])
    } else {
        let sign = relative.x.signum();
        (vec3(sign, 0.0, 0.0), [[local.y * sign, half.y], [-local.z, half.z]])
    }
}

/// Where a line enters and leaves the space between -half and half.
#[inline]
fn slab(origin: f32, direction: f32, half: f32) -> [f32; 2] {
    let inverse = 1.0 / if direction.abs() < 1e-9 { 1e-9 } else { direction };
    let middle = -origin * inverse;
    let reach = half * inverse.abs();
    [middle - reach, middle + reach]
}

/// Where a line enters and leaves the unit sphere; an empty range when it passes by.
#[inline]
fn unit_sphere(origin: Vec3, direction: Vec3) -> [f32; 2] {
    let a = direction.dot(direction);
    let b = origin.dot(direction);
    let discriminant = b * b - a * (origin.dot(origin) - 1.0);
    if discriminant < 0.0 {
        return [f32::INFINITY, f32::NEG_INFINITY];
    }
    let root = discriminant.sqrt();
    [(-b - root) / a, (-b + root) / a]
}

/// One machine instruction, unlike `f32::max`, which also has to think of NaN.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::texture::{Palette, Pattern};
    use crate::simulate::vector::gray;
    use proptest::prelude::*;

    fn solid(shape: Shape, center: Vec3, half: Vec3, yaw: f32) -> Solid {
        let texture = Palette::default().texture(Pattern::Paint, 0);
        let material = Material { texture, tint: gray(1.0), mapping: Mapping::Fitted, glow: 0.0 };
        Solid { shape, center, half, turn: [yaw.cos(), yaw.sin()], front: material, rest: material }
    }

    fn is_inside(solid: &Solid, point: Vec3) -> bool {
        let local = (point - solid.center).turned(solid.turn[0], -solid.turn[1]);
        let [x, y, z] = [local.x / solid.half.x, local.y / solid.half.y, local.z / solid.half.z];
        match solid.shape {
            Shape::Box => x.abs() <= 1.0 && y.abs() <= 1.0 && z.abs() <= 1.0,
            Shape::Cylinder => x.hypot(y) <= 1.0 && z.abs() <= 1.0,
            Shape::Ellipsoid => x * x + y * y + z * z <= 1.0,
        }
    }

    proptest! {
        #[test]
        fn a_ray_enters_where_small_steps_along_it_first_come_inside(
            shape in prop_oneof![Just(Shape::Box), Just(Shape::Cylinder), Just(Shape::Ellipsoid)],
            half in prop::array::uniform3(0.2_f32..1.5),
            target in prop::array::uniform3(-2.0_f32..2.0),
            yaw in 0.0_f32..6.0,
        ) {
            let solid = solid(shape, vec3(4.0, 0.5, 0.2), vec3(half[0], half[1], half[2]), yaw);
            let direction = (vec3(4.0, 0.5, 0.2) + vec3(target[0], target[1], target[2])).normalized();
            let steps = (0..8_000).map(|step| step as f32 * 0.001);
            let first = steps.clone().find(|&step| is_inside(&solid, direction * step));
            let entry = solid.entry(vec3(0.0, 0.0, 0.0), direction);
            match first {
                Some(step) => prop_assert!((entry - step).abs() < 0.002, "{entry} {step}"),
                // Steps may jump over a grazed edge.
                None if entry.is_finite() => {
                    let inner = Solid { half: solid.half * 0.99, ..solid };
                    prop_assert!(!steps.clone().any(|step| is_inside(&inner, direction * step)));
                }
                None => {}
            }
        }
    }

    #[test]
    fn the_front_faces_local_y_and_reads_from_left_to_right() {
        let board = solid(Shape::Box, vec3(0.0, 0.0, 1.0), vec3(1.0, 0.1, 0.5), 0.0);
        let upper_left = board.surface(vec3(0.99, 0.1, 1.49));
        assert_eq!(upper_left.normal, vec3(0.0, 1.0, 0.0));
        assert!(upper_left.uv[0] < 0.01 && upper_left.uv[1] < 0.02, "{:?}", upper_left.uv);
    }
}

//! Somebody who is in the robot's way.

use super::builder::Builder;
use super::robot::Pose;
use super::solid::{Material, Shape, Solid};
use super::texture::Pattern;
use super::vector::{Vec3, vec3};
use rand::Rng;

/// What somebody wears.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outfit {
    skin: Material,
    hair: Material,
    shirt: Material,
    trousers: Material,
    height: f32,
}

impl Outfit {
    /// Draws what is worn in one sequence.
    pub fn draw(b: &mut Builder) -> Self {
        let skin = b.varying(0.45, 1.0);
        let cloth = vec3(b.varying(0.1, 1.0), b.varying(0.1, 1.0), b.varying(0.1, 1.0));
        let denim = b.varying(0.1, 0.5);
        let variant = b.run.random();
        Self {
            skin: b.paint(vec3(0.85, 0.65, 0.52) * skin),
            hair: b.paint(vec3(0.3, 0.2, 0.12) * skin),
            shirt: Material { tint: cloth * 2.0, ..b.tiled(Pattern::Fabric, variant, 0.4) },
            trousers: b.paint(vec3(denim, denim, denim * 1.3)),
            height: b.varying(1.6, 1.92),
        }
    }
}

/// A person somewhere: body parts, and a cylinder round them all.
#[derive(Clone, Debug)]
pub(super) struct Person {
    bound: Solid,
    parts: Vec<Solid>,
}

impl Person {
    /// Somebody at a pose, `stride` radians into the cycle of two steps.
    pub fn new(outfit: &Outfit, at: Pose, stride: f32) -> Self {
        let turn = [at.heading.cos(), at.heading.sin()];
        let scale = outfit.height / 1.75;
        let part = |shape: Shape, center: [f32; 3], size: [f32; 3], material: Material| {
            let center = vec3(center[0], center[1], center[2]).turned(turn[0], turn[1]) * scale;
            let half = vec3(size[0], size[1], size[2]) * (scale / 2.0);
            let center = center + vec3(at.x, at.y, 0.0);
            Solid { shape, center, half, turn, front: material, rest: material }
        };
        let step = 0.16 * stride.sin();
        let mut parts = vec![
            part(Shape::Ellipsoid, [0.0, 0.0, 1.15], [0.3, 0.46, 0.78], outfit.shirt),
            part(Shape::Cylinder, [0.0, 0.0, 0.85], [0.24, 0.36, 0.2], outfit.trousers),
            part(Shape::Ellipsoid, [0.0, 0.0, 1.62], [0.2, 0.17, 0.26], outfit.skin),
            part(Shape::Ellipsoid, [-0.02, 0.0, 1.66], [0.21, 0.185, 0.22], outfit.hair),
            part(Shape::Cylinder, [0.0, 0.0, 1.5], [0.1, 0.1, 0.12], outfit.skin),
        ];
        for (side, swing) in [(-1.0, step), (1.0, -step)] {
            parts.push(part(Shape::Cylinder, [swing, side * 0.1, 0.42], [0.16, 0.15, 0.84], outfit.trousers));
            parts.push(part(Shape::Box, [swing + 0.05, side * 0.1, 0.04], [0.27, 0.1, 0.08], outfit.hair));
            parts.push(part(Shape::Ellipsoid, [-swing, side * 0.25, 1.1], [0.12, 0.11, 0.62], outfit.shirt));
            parts.push(part(
                Shape::Ellipsoid,
                [-swing * 1.2, side * 0.25, 0.8],
                [0.09, 0.07, 0.16],
                outfit.skin,
            ));
        }
        let bound = part(Shape::Cylinder, [0.0, 0.0, 0.95], [1.1, 1.1, 1.9], outfit.shirt);
        Self { bound, parts }
    }

    /// The part that a ray meets before `nearest`, and where.
    pub fn entry(&self, origin: Vec3, direction: Vec3, nearest: f32) -> Option<(f32, &Solid)> {
        if self.bound.entry(origin, direction) >= nearest {
            return None;
        }
        let entries = self.parts.iter().map(|part| (part.entry(origin, direction), part));
        let first = entries.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        (first.0 < nearest).then_some(first)
    }
}

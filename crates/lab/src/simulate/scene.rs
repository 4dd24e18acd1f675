//! A lab as it stands during one sequence, and the light that comes along a ray in it.

use super::builder::Builder;
use super::building::{Shell, floor_material};
use super::caster::Caster;
use super::furniture::furnish;
use super::light::{LightField, Sun};
use super::person::{Outfit, Person};
use super::plan::Plan;
use super::solid::{Mapping, Material, SurfacePoint};
use super::texture::{Pattern, Textures};
use super::vector::{Color, Vec3, gray, vec3};
use super::{Illumination, Route, SequenceSpec, mixed, seeded};
use rand::Rng;
use std::f32::consts::TAU;

/// Everything that a ray can meet.
pub(super) struct Scene {
    plan: Plan,
    caster: Caster,
    textures: Textures,
    light: LightField,
    sun: Option<Sun>,
    /// The floor of each room.
    floors: Vec<Material>,
    ceiling: Material,
    /// What the person in the way wears.
    outfit: Outfit,
}

/// A ray of sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub origin: Vec3,
    /// A unit vector.
    pub direction: Vec3,
    /// The angle that the pixel covers, in radians.
    pub spread: f32,
}

impl Scene {
    /// Builds, furnishes and lights the lab of a sequence; `way` are points that the robot comes by.
    pub fn build(spec: &SequenceSpec, plan: Plan, way: Vec<[f32; 2]>) -> Self {
        let mut b = Builder::new([seeded(&spec.lab_key()), seeded(&spec.run_key())], way);
        let shell = Shell::new(&mut b, plan.ceiling, spec.illumination);
        let mut floors = Vec::new();
        for (room_idx, room) in plan.rooms.iter().enumerate() {
            b.room_idx = room_idx;
            // A room's looks depend on nothing that was built before it.
            b.layout = seeded(&[&spec.lab_key()[..], &[room_idx as u64]].concat());
            b.run = seeded(&[&spec.run_key()[..], &[room_idx as u64]].concat());
            floors.push(floor_material(&mut b, room.kind));
            let is_visited = room.is_standard || spec.route == Route::Extended;
            let is_open = is_visited || b.run.random_bool(0.5);
            shell.build(&mut b, room, is_open);
            furnish(&mut b, room);
        }
        let ceiling = b.tiled(Pattern::CeilingTiles, 0, 0.62);
        let outfit = Outfit::draw(&mut b);
        let textures = b.palette.paint(mixed(&[spec.seed, spec.lab as u64]));
        let caster = Caster::new(b.solids, plan.bounds());
        let sun = (spec.illumination == Illumination::Sunny).then(|| {
            let mut rng = seeded(&[&spec.run_key()[..], &[u64::MAX]].concat());
            // The lab's windows look the same way every day; the hour differs.
            let south = seeded(&spec.lab_key()).random_range(0.0..TAU);
            let azimuth = south + rng.random_range(-0.5..0.5);
            let elevation = rng.random_range(0.35_f32..0.75);
            let toward =
                vec3(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
            Sun::new(toward, vec3(9.0, 8.6, 7.6), &b.panes)
        });
        let mut lights = b.lights;
        if let Some(sun) = &sun {
            lights.extend(sun.reflections(&caster));
        }
        let light = LightField::bake(&plan, &caster, &lights);
        Self { plan, caster, textures, light, sun, floors, ceiling, outfit }
    }

    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    pub fn outfit(&self) -> &Outfit {
        &self.outfit
    }

    /// The light that comes along a ray, with a person standing about or not.
    pub fn radiance(&self, ray: &Ray, person: Option<&Person>) -> Color {
        let Ray { origin, direction, .. } = *ray;
        let is_down = direction.z < 0.0;
        let to_plane = if is_down { 0.0 } else { self.plan.ceiling } - origin.z;
        let reach = to_plane / direction.z;
        let hit = self.caster.cast(origin, direction, reach);
        let nearest = hit.map_or(reach, |hit| hit.distance);
        if let Some((distance, solid)) = person.and_then(|person| person.entry(origin, direction, nearest)) {
            return self.shade(ray, distance, |_, point| solid.surface(point));
        }
        match hit {
            Some(hit) => {
                let solid = self.caster.solid(hit.solid_idx);
                self.shade(ray, hit.distance, |_, point| solid.surface(point))
            }
            None => self.shade(ray, reach, |scene, point| scene.horizontal(point, is_down)),
        }
    }

    /// How far a level beam goes until it meets something, a person included; none where it meets nothing within `reach`.
    pub fn reach(&self, origin: Vec3, direction: Vec3, reach: f32, person: Option<&Person>) -> Option<f32> {
        let hit = self.caster.cast(origin, direction, reach).map(|hit| hit.distance);
        let of_person = person
            .and_then(|person| person.entry(origin, direction, hit.unwrap_or(reach)))
            .map(|(distance, _)| distance);
        of_person.or(hit)
    }

    #[cfg(test)]
    pub fn is_clear(&self, from: Vec3, to: Vec3) -> bool {
        self.caster.is_clear(from, to)
    }

    /// The light on a white surface that faces up, at a point.
    pub fn light_from_above(&self, point: Vec3) -> Color {
        let room_idx = self.plan.room_at(point.x, point.y);
        self.light.irradiance(room_idx, point, vec3(0.0, 0.0, 1.0))
    }

    /// The floor or the ceiling at a point.
    fn horizontal(&self, point: Vec3, is_floor: bool) -> SurfacePoint {
        let (material, up) = if is_floor {
            (self.floors[self.plan.room_at(point.x, point.y)], 1.0)
        } else {
            (self.ceiling, -1.0)
        };
        let Mapping::Tiled(meters) = material.mapping else {
            return SurfacePoint { normal: vec3(0.0, 0.0, up), material, uv: [0.0; 2], repeats: 1.0 };
        };
        let uv = [point.x / meters, point.y / meters];
        SurfacePoint { normal: vec3(0.0, 0.0, up), material, uv, repeats: 1.0 / meters }
    }

    fn shade(&self, ray: &Ray, distance: f32, surface: impl Fn(&Self, Vec3) -> SurfacePoint) -> Color {
        let point = ray.origin + ray.direction * distance;
        let SurfacePoint { normal, material, uv, repeats } = surface(self, point);
        if material.mapping == Mapping::Outside {
            return self.outside(ray, &material);
        }
        // Across and along a slanted surface a pixel covers different lengths: take their mean.
        let slant = 1.0 / normal.dot(ray.direction).abs().max(0.08);
        let footprint = distance * ray.spread * repeats * slant.sqrt();
        let albedo = self.textures.sample(material.texture, uv, footprint) * material.tint;
        if material.glow > 0.0 {
            return albedo * material.glow;
        }
        let lifted = point + normal * 0.02;
        let room_idx = self.plan.room_at(lifted.x, lifted.y);
        let light = self.light.irradiance(room_idx, point, normal);
        albedo * (light + self.sunlight(lifted, normal))
    }

    fn sunlight(&self, point: Vec3, normal: Vec3) -> Color {
        let Some(sun) = &self.sun else {
            return gray(0.0);
        };
        let facing = normal.dot(sun.toward);
        if facing <= 0.0 {
            return gray(0.0);
        }
        match sun.entry(point) {
            Some(entry) if self.caster.is_clear(point, entry) => sun.strength * facing,
            _ => gray(0.0),
        }
    }

    /// What is seen through a window: a panorama so far away that only the direction counts.
    fn outside(&self, ray: &Ray, material: &Material) -> Color {
        let Vec3 { x, y, z } = ray.direction;
        let uv = [y.atan2(x) / TAU * 2.0, 0.5 - z.clamp(-0.49, 0.49)];
        self.textures.sample(material.texture, uv, ray.spread / TAU * 2.0) * material.glow
    }
}

//! Three numbers: a point or direction in meters, or a linear color.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A point or direction: x and y in the floor plane, z up, in meters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Vec3 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

/// A color: x red, y green, z blue. Radiance and albedo are linear; painted textures are gamma-encoded.
pub(super) type Color = Vec3;

/// The vector (x, y, z).
pub(super) const fn vec3(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3 { x, y, z }
}

/// The gray color of this brightness.
pub(super) const fn gray(brightness: f32) -> Color {
    vec3(brightness, brightness, brightness)
}

impl Vec3 {
    pub fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    pub fn length(self) -> f32 {
        self.dot(self).sqrt()
    }

    pub fn normalized(self) -> Self {
        self * (1.0 / self.length())
    }

    /// Turned about the vertical by the angle with this cosine and sine.
    pub fn turned(self, cos: f32, sin: f32) -> Self {
        vec3(cos * self.x - sin * self.y, sin * self.x + cos * self.y, self.z)
    }

    /// The mean of the three numbers.
    pub fn mean(self) -> f32 {
        (self.x + self.y + self.z) / 3.0
    }
}

impl Add for Vec3 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        vec3(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for Vec3 {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vec3 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        vec3(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl Mul<f32> for Vec3 {
    type Output = Self;
    fn mul(self, factor: f32) -> Self {
        vec3(self.x * factor, self.y * factor, self.z * factor)
    }
}

/// Component by component, as light on a colored surface.
impl Mul for Vec3 {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        vec3(self.x * other.x, self.y * other.y, self.z * other.z)
    }
}

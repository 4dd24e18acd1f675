//! What the CPU has beyond the baseline. There is a value only where it has the instructions; who has one may execute them.

use std::arch::is_x86_feature_detected as has;

/// AVX2.
#[derive(Clone, Copy)]
pub struct Avx2(());

impl Avx2 {
    /// `None` where the CPU lacks it.
    pub fn detected() -> Option<Self> {
        has!("avx2").then_some(Self(()))
    }
}

/// AVX-512 with bytes, words and shorter vectors.
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Avx512 {
    /// `None` where the CPU lacks it.
    pub fn detected() -> Option<Self> {
        (has!("avx512f") && has!("avx512bw") && has!("avx512vl")).then_some(Self(()))
    }
}

/// AVX-512 with the instruction that multiplies four bytes and adds the products.
#[derive(Clone, Copy)]
pub struct Avx512Vnni(());

impl Avx512Vnni {
    /// `None` where the CPU lacks it.
    pub fn detected() -> Option<Self> {
        (Avx512::detected().is_some() && has!("avx512vnni")).then_some(Self(()))
    }
}

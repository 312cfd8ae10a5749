//! Random numbers by counter: a value depends on its seed, stream and index alone, never on who asks first.

/// Sixty-four random bits, for a seed of its own.
pub fn word(seed: u64, stream: u64, index: u64) -> u64 {
    mix(seed, stream, index)
}

/// Mixes three words into one (the finaliser of SplitMix64, applied in turn).
fn mix(seed: u64, stream: u64, index: u64) -> u64 {
    let mut z = 0u64;
    for word in [seed, stream, index] {
        z = (z ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

/// Uniform in [0, 1).
pub fn uniform(seed: u64, stream: u64, index: u64) -> f64 {
    (mix(seed, stream, index) >> 11) as f64 / (1u64 << 53) as f64
}

/// A random rotation, uniform over all orientations (Shoemake 1992).
pub fn rotation(seed: u64, stream: u64, index: u64) -> glam::DQuat {
    let [a, b, c] = [0, 1, 2].map(|k| uniform(seed, stream, 3 * index + k));
    let (u, v) = ((1.0 - a).sqrt(), a.sqrt());
    let (b, c) = (std::f64::consts::TAU * b, std::f64::consts::TAU * c);
    glam::DQuat::from_xyzw(u * b.sin(), u * b.cos(), v * c.sin(), v * c.cos()).normalize()
}

#[cfg(test)]
mod tests {
    #[test]
    fn uniform_has_the_moments_of_a_uniform_variable() {
        let n = 100_000;
        let x: Vec<f64> = (0..n).map(|i| super::uniform(7, 3, i)).collect();
        let mean = x.iter().sum::<f64>() / n as f64;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        // five standard errors of each
        assert!((mean - 0.5).abs() < 5.0 * (1.0f64 / 12.0 / n as f64).sqrt());
        assert!((variance - 1.0 / 12.0).abs() < 5.0 * (1.0f64 / 180.0 / n as f64).sqrt());
    }
}

//! E2: smoothing kernels with their norms, and sums over lattices.
//!
//! A kernel is used through its support radius `H`: `W = 0` at `r >= H`. The shapes are in `kernel.wgsl`;
//! this file holds the norms and lets a run choose a kernel by name. All values are in SI units: `W` in
//! m^-3 (m^-2 in two dimensions).

use super::shape;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// One smoothing function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// Cubic spline (Monaghan 1992), `H = 2 h`.
    Cubic,
    /// Wendland C2 (Wendland 1995), `H = 2 h`.
    WendlandC2,
    /// Wendland C4 (Wendland 1995), `H = 2 h`.
    WendlandC4,
    /// Quintic spline (Morris et al. 1997), `H = 3 h`.
    Quintic,
    /// Poly6 (Mueller et al. 2003), `H = h`.
    Poly6,
    /// Spiky (Mueller et al. 2003), `H = h`: used for its gradient.
    Spiky,
    /// Viscosity kernel (Mueller et al. 2003), `H = h`: used for its Laplacian. Three dimensions only for `W`.
    Viscosity,
}

/// The choice of kernels of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KernelSet {
    /// Cubic spline for everything.
    Cubic,
    /// Wendland C2 for everything: does not clump; the default.
    #[default]
    WendlandC2,
    /// Wendland C4 for everything: smoother, wants a larger support.
    WendlandC4,
    /// Quintic spline for everything, wants a larger support.
    Quintic,
    /// Poly6 for density, spiky for pressure (Mueller et al. 2003; Young and Erlebacher).
    Mueller,
}

impl KernelSet {
    /// The kernel whose `W` weighs densities.
    pub fn density(self) -> Kernel {
        match self {
            Self::Cubic => Kernel::Cubic,
            Self::WendlandC2 => Kernel::WendlandC2,
            Self::WendlandC4 => Kernel::WendlandC4,
            Self::Quintic => Kernel::Quintic,
            Self::Mueller => Kernel::Poly6,
        }
    }

    /// The kernel whose gradient carries forces.
    pub fn force(self) -> Kernel {
        match self {
            Self::Mueller => Kernel::Spiky,
            other => other.density(),
        }
    }
}

/// The same code for each kernel, `$k` a constant in it: the choice is made outside of loops, for inside it keeps the
/// compiler from wide instructions.
macro_rules! each_kernel {
    ($kernel:expr, $k:ident => $body:expr) => {
        each_kernel!($kernel, $k => $body; Cubic WendlandC2 WendlandC4 Quintic Poly6 Spiky Viscosity)
    };
    ($kernel:expr, $k:ident => $body:expr; $($name:ident)*) => {
        match $kernel {
            $($crate::laws::kernel::Kernel::$name => {
                const $k: $crate::laws::kernel::Kernel = $crate::laws::kernel::Kernel::$name;
                $body
            })*
        }
    };
}
pub(crate) use each_kernel;

impl Kernel {
    /// Every kernel there is.
    pub const ALL: [Kernel; 7] =
        [Self::Cubic, Self::WendlandC2, Self::WendlandC4, Self::Quintic, Self::Poly6, Self::Spiky, Self::Viscosity];

    /// Norm of `W` for `H = 1` in `dimensions` (2 or 3).
    pub fn norm(self, dimensions: u32) -> f64 {
        let three = dimensions == 3;
        match self {
            Self::Cubic => {
                if three {
                    8.0 / PI
                } else {
                    40.0 / (7.0 * PI)
                }
            }
            Self::WendlandC2 => {
                if three {
                    21.0 / (2.0 * PI)
                } else {
                    7.0 / PI
                }
            }
            Self::WendlandC4 => {
                if three {
                    495.0 / (32.0 * PI)
                } else {
                    9.0 / PI
                }
            }
            Self::Quintic => {
                if three {
                    27.0 / (120.0 * PI)
                } else {
                    63.0 / (478.0 * PI)
                }
            }
            Self::Poly6 => {
                if three {
                    315.0 / (64.0 * PI)
                } else {
                    4.0 / PI
                }
            }
            Self::Spiky => {
                if three {
                    15.0 / PI
                } else {
                    10.0 / PI
                }
            }
            Self::Viscosity => 15.0 / (2.0 * PI),
        }
    }

    /// Norm of the viscosity kernel's Laplacian for `H = 1`: `nabla^2 W = norm (1 - s) / H^(d+2)`.
    pub fn laplacian_norm(dimensions: u32) -> f64 {
        if dimensions == 3 { 45.0 / PI } else { 40.0 / PI }
    }

    /// Shape `w(s)`, `s = r / H`, without its norm.
    #[inline(always)]
    pub fn w(self, s: f32) -> f32 {
        match self {
            Self::Cubic => shape::cubic_w(s),
            Self::WendlandC2 => shape::wendland_quintic_w(s),
            Self::WendlandC4 => shape::wendland_sextic_w(s),
            Self::Quintic => shape::quintic_w(s),
            Self::Poly6 => shape::poly_six_w(s),
            Self::Spiky => shape::spiky_w(s),
            Self::Viscosity => shape::viscosity_w(s),
        }
    }

    /// Shape `g(s) = w'(s) / s` of the gradient, without its norm. The viscosity kernel, which serves only its
    /// Laplacian, gives the Laplacian's shape here.
    #[inline(always)]
    pub fn g(self, s: f32) -> f32 {
        match self {
            Self::Cubic => shape::cubic_g(s),
            Self::WendlandC2 => shape::wendland_quintic_g(s),
            Self::WendlandC4 => shape::wendland_sextic_g(s),
            Self::Quintic => shape::quintic_g(s),
            Self::Poly6 => shape::poly_six_g(s),
            Self::Spiky => shape::spiky_g(s),
            Self::Viscosity => shape::viscosity_laplacian(s),
        }
    }

    /// `W(r)` for support `support` (m), double precision outside, single inside, as the simulation uses it.
    pub fn value(self, r: f64, support: f64, dimensions: u32) -> f64 {
        if r >= support {
            return 0.0;
        }
        self.norm(dimensions) / support.powi(dimensions as i32) * f64::from(self.w((r / support) as f32))
    }

    /// `dW/dr` for support `support` (m).
    pub fn slope(self, r: f64, support: f64, dimensions: u32) -> f64 {
        if r >= support {
            return 0.0;
        }
        self.norm(dimensions) / support.powi(dimensions as i32 + 2) * f64::from(self.g((r / support) as f32)) * r
    }

    /// `sum W dx^d` over the infinite square or cubic lattice, the particle itself included, for a support of
    /// `support_over_spacing` spacings: the `S` by which densities are calibrated.
    pub fn lattice_sum(self, support_over_spacing: f64, dimensions: u32) -> f64 {
        over_lattice(support_over_spacing, dimensions, |r, _| self.value(r, support_over_spacing, dimensions))
    }

    /// `-sum x dW/dx dx^d` over the infinite lattice: 1 where gradients are exact, the factor by which they are
    /// calibrated.
    pub fn lattice_gradient(self, support_over_spacing: f64, dimensions: u32) -> f64 {
        over_lattice(support_over_spacing, dimensions, |r, x| {
            if r == 0.0 { 0.0 } else { -x * x / r * self.slope(r, support_over_spacing, dimensions) }
        })
    }

    /// Largest eigenvalue, over all waves, of what Jacobi's rounds of implicit pressure (E9) iterate on the infinite lattice:
    /// `|sum_j e_ij sin(k . x_ij)|^2 / sum_j |e_ij|^2`, `e_ij = V_j grad_i W_ij`; and `dx^2 sum_j |e_ij|^2` for exact gradients.
    pub fn lattice_stiffness(self, support_over_spacing: f64, dimensions: u32) -> (f64, f64) {
        const WAVES: i32 = 16;
        let mut near = Vec::new();
        lattice(support_over_spacing, dimensions, |r, x| {
            let slope = if r > 0.0 { self.slope(r, support_over_spacing, dimensions) / r } else { 0.0 };
            near.push((x, slope * x));
        });
        let own: f64 = near.iter().map(|(_, e)| e.length_squared()).sum();
        let waves = |axis: i32| 0..=if axis == 1 && dimensions == 2 { 0 } else { WAVES };
        let mut largest = 0.0f64;
        for (i, j, k) in waves(0).flat_map(|i| waves(1).flat_map(move |j| waves(2).map(move |k| (i, j, k)))) {
            let wave = PI / f64::from(WAVES) * DVec3::new(i.into(), j.into(), k.into());
            let sum: DVec3 = near.iter().map(|(x, e)| wave.dot(*x).sin() * *e).sum();
            largest = largest.max(sum.length_squared());
        }
        (largest / own, own / self.lattice_gradient(support_over_spacing, dimensions).powi(2))
    }

    /// `sum x^2 nabla^2 W dx^d / 2` of the viscosity kernel over the infinite lattice: 1 where Laplacians are exact.
    pub fn lattice_laplacian(support_over_spacing: f64, dimensions: u32) -> f64 {
        let factor = Self::laplacian_norm(dimensions) / support_over_spacing.powi(dimensions as i32 + 2);
        over_lattice(support_over_spacing, dimensions, |r, x| {
            0.5 * x * x * factor * f64::from(Self::Viscosity.g((r / support_over_spacing) as f32))
        })
    }
}

/// Sum of `f(r, x)` over the points of the infinite lattice within the support, in units of the spacing.
fn over_lattice(support: f64, dimensions: u32, f: impl Fn(f64, f64) -> f64) -> f64 {
    let mut sum = 0.0;
    lattice(support, dimensions, |r, x| sum += f(r, x.x));
    sum
}

/// The points of the infinite lattice within the support, and how far they are from its middle, in units of the spacing.
fn lattice(support: f64, dimensions: u32, mut each: impl FnMut(f64, DVec3)) {
    let n = support.ceil() as i32;
    let depth = if dimensions == 3 { n } else { 0 };
    for i in -n..=n {
        for j in -depth..=depth {
            for k in -n..=n {
                let x = DVec3::new(i.into(), j.into(), k.into());
                each(x.length(), x);
            }
        }
    }
}

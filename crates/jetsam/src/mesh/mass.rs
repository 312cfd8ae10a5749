//! Volume, centre of mass and inertia of the solid a closed mesh bounds.
//!
//! By the divergence theorem the integrals of 1, x and x xᵀ over the solid are sums over the tetrahedra spanned by a
//! fixed point and each triangle (Mirtich, "Fast and accurate computation of polyhedral mass properties", 1996; the
//! tetrahedron's moments as in Tonon 2004). Exact to rounding; meaningless for an open mesh.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::Mesh;

/// Integrals of a solid of density one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// Volume, in length³; negative for a mesh that is inside out.
    pub volume: f64,
    /// Centre of mass.
    pub com: DVec3,
    /// Inertia tensor about the centre of mass at unit density, in length⁵.
    pub inertia: DMat3,
}

impl MassProperties {
    /// From the integrals over the solid of 1, of d and of d dᵀ, with d = x - `base`.
    pub(crate) fn from_moments(base: DVec3, volume: f64, first: DVec3, second: DMat3) -> MassProperties {
        let d = if volume == 0.0 { DVec3::ZERO } else { first / volume };
        let central = second - outer(d, d) * volume;
        let trace = central.x_axis.x + central.y_axis.y + central.z_axis.z;
        MassProperties { volume, com: base + d, inertia: DMat3::IDENTITY * trace - central }
    }

    /// The tensor as `[xx, yy, zz, xy, xz, yz]`.
    pub fn inertia6(&self) -> [f64; 6] {
        let m = self.inertia;
        [m.x_axis.x, m.y_axis.y, m.z_axis.z, m.y_axis.x, m.z_axis.x, m.z_axis.y]
    }
}

/// The matrix a bᵀ.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Mesh {
    /// Volume, centre of mass and inertia of the solid inside, exact to rounding for a closed mesh. Overlapping
    /// parts count as often as they overlap; inverted parts count negative.
    pub fn mass_properties(&self) -> MassProperties {
        let Some((lo, hi)) = self.bounds() else {
            return MassProperties { volume: 0.0, com: DVec3::ZERO, inertia: DMat3::ZERO };
        };
        let base = 0.5 * (lo + hi);
        let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for &t in &self.triangles {
            let [a, b, c] = self.corners(t).map(|v| v - base);
            let v = a.dot(b.cross(c)) / 6.0;
            let sum = a + b + c;
            volume += v;
            first += sum * (v / 4.0);
            second += (outer(a, a) + outer(b, b) + outer(c, c) + outer(sum, sum)) * (v / 20.0);
        }
        MassProperties::from_moments(base, volume, first, second)
    }
}

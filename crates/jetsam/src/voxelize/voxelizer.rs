//! Where the voxelizer runs: on the processor, or with the parity rule on a GPU.
//!
//! In: a [`Backend`]. Out: a [`Voxelizer`], which keeps the device open between meshes. The grid is the same to the last
//! bit wherever it is made.

use super::bits::BitGrid;
use super::fill::{self, Shape};
#[cfg(feature = "gpu")]
use super::fill_gpu::FillGpu;
use super::{Backend, Rule, VoxelizeError, VoxelizeOptions, Voxels};
use crate::gpu::GpuError;
use crate::mesh::Mesh;

/// Voxelizes meshes, on the CPU or with the parity rule on a GPU. [`super::voxelize`] is one on the CPU.
#[derive(Default)]
pub struct Voxelizer {
    backend: Backend,
    #[cfg(feature = "gpu")]
    gpu: Option<FillGpu>,
}

/// What did the work, for the report.
#[derive(Default)]
pub(super) struct Ran {
    /// Name of the device; `None` for the CPU.
    pub device: Option<String>,
    pub kernel_millis: Option<f64>,
    /// Why it was not the GPU although it was meant to be.
    pub instead: Option<String>,
}

impl Voxelizer {
    /// Opens what the backend asks for: for [`Backend::Gpu`] the most welcome device there is, for [`Backend::Auto`] a
    /// GPU if there is one in fact, else the CPU.
    ///
    /// # Errors
    /// [`Backend::Gpu`] without a GPU that works, or without the feature `gpu`.
    pub fn new(backend: Backend) -> Result<Voxelizer, VoxelizeError> {
        #[cfg(feature = "gpu")]
        {
            let open = |only_hardware| crate::gpu::Gpu::open(only_hardware).and_then(FillGpu::new);
            let gpu = match backend {
                Backend::Cpu => None,
                Backend::Auto => open(true).ok(),
                Backend::Gpu => Some(open(false).map_err(VoxelizeError::Gpu)?),
            };
            Ok(Voxelizer { backend, gpu })
        }
        #[cfg(not(feature = "gpu"))]
        match backend {
            Backend::Gpu => Err(VoxelizeError::Gpu(GpuError::NotBuilt)),
            _ => Ok(Voxelizer { backend }),
        }
    }

    /// Turns the mesh into cells.
    ///
    /// # Errors
    /// Those of [`super::voxelize`]; with [`Backend::Gpu`] also those of the device. With [`Backend::Auto`] the CPU steps in
    /// for a device that fails, and a warning of the report says so.
    pub fn voxelize(
        &self,
        mesh: &Mesh,
        options: &VoxelizeOptions,
    ) -> Result<Voxels, VoxelizeError> {
        super::run(self, mesh, options)
    }

    /// As if the GPU were taken out of the machine, to test what becomes of it.
    #[doc(hidden)]
    pub fn lose_device(&self) {
        #[cfg(feature = "gpu")]
        self.gpu.iter().for_each(FillGpu::lose);
    }

    /// What will do the work by that rule, for the report.
    pub(super) fn plan(&self, rule: Rule) -> Ran {
        let asked_in_vain = self.backend == Backend::Gpu && rule == Rule::Winding;
        Ran {
            instead: asked_in_vain.then(|| {
                "the winding rule ran on the CPU: only the parity rule has a GPU twin".into()
            }),
            ..Ran::default()
        }
    }

    /// Fills an empty grid by parity. Returns the rows that are not to be trusted; see [`fill::parity`].
    pub(super) fn parity(
        &self,
        shape: &Shape,
        grid: &mut BitGrid,
        ran: &mut Ran,
    ) -> Result<Vec<u64>, VoxelizeError> {
        match self.parity_gpu(shape, grid, ran) {
            Some(Ok(odd)) => return Ok(odd),
            Some(Err(fault)) if self.backend == Backend::Gpu => {
                return Err(VoxelizeError::Gpu(fault));
            }
            Some(Err(fault)) => {
                ran.instead = Some(format!("the CPU stepped in for the GPU: {fault}"));
                *grid = BitGrid::new(grid.dims());
            }
            None => {}
        }
        Ok(fill::parity(shape, grid))
    }

    /// `None` where there is no GPU.
    #[cfg(feature = "gpu")]
    fn parity_gpu(
        &self,
        shape: &Shape,
        grid: &mut BitGrid,
        ran: &mut Ran,
    ) -> Option<Result<Vec<u64>, GpuError>> {
        let gpu = self.gpu.as_ref()?;
        Some(gpu.parity(shape, grid).map(|filled| {
            ran.device = Some(gpu.name());
            ran.kernel_millis = filled.kernel_millis;
            filled.odd
        }))
    }

    #[cfg(not(feature = "gpu"))]
    fn parity_gpu(
        &self,
        _: &Shape,
        _: &mut BitGrid,
        _: &mut Ran,
    ) -> Option<Result<Vec<u64>, GpuError>> {
        None
    }
}

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
    /// Why there is a GPU but it was not opened.
    fault: Option<GpuError>,
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
        let mut voxelizer = Voxelizer { backend, ..Voxelizer::default() };
        match (backend, voxelizer.open()) {
            (Backend::Gpu, Err(fault)) => return Err(VoxelizeError::Gpu(fault)),
            (_, Err(GpuError::NoAdapter | GpuError::NotBuilt)) | (_, Ok(())) => {}
            (_, Err(fault)) => voxelizer.fault = Some(fault),
        }
        Ok(voxelizer)
    }

    /// Opens the GPU, if one is wanted.
    #[cfg(feature = "gpu")]
    fn open(&mut self) -> Result<(), GpuError> {
        if self.backend != Backend::Cpu {
            let gpu = crate::gpu::Gpu::open(self.backend == Backend::Auto)?;
            self.gpu = Some(FillGpu::new(gpu)?);
        }
        Ok(())
    }

    #[cfg(not(feature = "gpu"))]
    fn open(&mut self) -> Result<(), GpuError> {
        Err(GpuError::NotBuilt)
    }

    /// Turns the mesh into cells.
    ///
    /// # Errors
    /// Those of [`super::voxelize`]; with [`Backend::Gpu`] also those of the device. With [`Backend::Auto`] the CPU steps in
    /// for a device that fails, and a warning of the report says so.
    pub fn voxelize(&self, mesh: &Mesh, options: &VoxelizeOptions) -> Result<Voxels, VoxelizeError> {
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
        let instead = match rule {
            Rule::Parity => self.fault.as_ref().map(stepped_in),
            Rule::Winding => (self.backend == Backend::Gpu)
                .then(|| "the winding rule ran on the CPU: only the parity rule has a GPU twin".into()),
        };
        Ran { instead, ..Ran::default() }
    }

    /// Fills an empty grid by parity. Returns the rows that are not to be trusted; see [`fill::parity`].
    pub(super) fn parity(&self, shape: &Shape, grid: &mut BitGrid, ran: &mut Ran) -> Result<Vec<u64>, VoxelizeError> {
        match self.parity_gpu(shape, grid, ran) {
            Some(Ok(odd)) => return Ok(odd),
            Some(Err(fault)) if self.backend == Backend::Gpu => {
                return Err(VoxelizeError::Gpu(fault));
            }
            Some(Err(fault)) => {
                ran.instead = Some(stepped_in(&fault));
                *grid = BitGrid::new(grid.dims());
            }
            None => {}
        }
        Ok(fill::parity(shape, grid))
    }

    /// `None` where there is no GPU.
    #[cfg(feature = "gpu")]
    fn parity_gpu(&self, shape: &Shape, grid: &mut BitGrid, ran: &mut Ran) -> Option<Result<Vec<u64>, GpuError>> {
        let gpu = self.gpu.as_ref()?;
        Some(gpu.parity(shape, grid).map(|filled| {
            ran.device = Some(gpu.name());
            ran.kernel_millis = filled.kernel_millis;
            filled.odd
        }))
    }

    #[cfg(not(feature = "gpu"))]
    fn parity_gpu(&self, _: &Shape, _: &mut BitGrid, _: &mut Ran) -> Option<Result<Vec<u64>, GpuError>> {
        None
    }
}

fn stepped_in(fault: &GpuError) -> String {
    format!("the CPU stepped in for the GPU: {fault}")
}

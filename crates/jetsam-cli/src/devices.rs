//! `jetsam devices`: the compute adapters of this machine.

use crate::terminal::{print, say, table};
use crate::{Outcome, args};

/// Lists the adapters. Software ones (a processor that plays a graphics processor) are named as such: they are
/// never chosen unasked.
pub fn devices(args: &args::Devices) -> miette::Result<Outcome> {
    let devices = jetsam::gpu::devices();
    if args.json {
        print(&serde_json::to_string_pretty(&devices).expect("devices are plain"));
    } else if devices.is_empty() {
        say("no compute adapter was found: install a Vulkan, Metal or DirectX 12 driver; the processor needs none");
    } else {
        let rows = devices.iter().map(|d| {
            let kind = if d.is_hardware() { "hardware" } else { "software" };
            (d.name.as_str(), format!("{kind}, {}, {}", d.api, d.driver))
        });
        print(&table(&rows.collect::<Vec<_>>()));
    }
    Ok(Outcome::Fine)
}

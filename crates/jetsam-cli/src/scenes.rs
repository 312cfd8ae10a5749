//! `jetsam scenes`: the scenes that come with the program.

use crate::Outcome;
use crate::args;
use crate::terminal::{print, table};
use jetsam::Scene;
use jetsam::scene::builtin::SCENES;
use serde::Serialize;

/// What is said of a scene.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    title: String,
    dimensions: u32,
    spacing: f64,
    seconds: f64,
}

/// Lists the built-in scenes.
pub fn scenes(args: &args::Scenes) -> miette::Result<Outcome> {
    let mut rows = Vec::new();
    for builtin in SCENES {
        let scene = Scene::open(builtin.name, &[]).map_err(|e| *e)?;
        rows.push(Row {
            name: builtin.name,
            title: scene.title,
            dimensions: scene.world.dimensions,
            spacing: scene.resolution.spacing,
            seconds: scene.run.seconds,
        });
    }
    if args.json {
        print(&serde_json::to_string_pretty(&rows).expect("rows are plain"));
    } else {
        print(&table(&rows.into_iter().map(|r| (r.name, r.title)).collect::<Vec<_>>()));
    }
    Ok(Outcome::Fine)
}

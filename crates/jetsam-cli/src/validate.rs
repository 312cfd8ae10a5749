//! `jetsam validate`: validation cases run and judged; a table, JSON, plots.

use crate::args::Validate;
use crate::output::at;
use crate::run::set_threads;
use crate::terminal::{print, print_json, progress, say, table};
use crate::{Outcome, terminal};
use jetsam::Scene;
use jetsam::validate::{Report, Row, Verdict, cases, markdown, run, short};
use std::path::Path;

/// Parts into which a case's progress is cut.
const PARTS: f64 = 1000.0;

/// Runs the cases asked for.
pub fn validate(args: &Validate) -> miette::Result<Outcome> {
    set_threads(args.threads)?;
    let cases = cases::select(&args.cases).map_err(|e| *e)?;
    if args.list {
        return list(&cases);
    }
    let mut reports = Vec::new();
    for (name, source) in &cases {
        let bar = progress(PARTS as u64, name);
        let report = run(name, source, &args.set, args.backend.into(), &mut |variant, part| {
            bar.set_message(variant.to_owned());
            bar.set_position((PARTS * part) as u64);
        });
        bar.finish_and_clear();
        let report = report.map_err(|e| *e)?;
        if args.json {
            report.rows.iter().for_each(print_json);
        } else {
            print(&text(&report));
        }
        if let Some(folder) = &args.out {
            write(folder, &report)?;
        }
        reports.push(report);
    }
    if let Some(folder) = &args.out {
        let how =
            format!("`jetsam validate{}` wrote this.", args.cases.iter().map(|c| format!(" {c}")).collect::<String>());
        let path = folder.join("validation.md");
        std::fs::write(&path, markdown(&reports, &how)).map_err(at(&path))?;
    }
    let all = || reports.iter().flat_map(|r| &r.rows);
    let count = |v| all().filter(|r| r.verdict == v).count();
    let (ok, fail) = (count(Verdict::Ok), count(Verdict::Fail));
    let seconds: f64 = reports.iter().map(Report::seconds).sum();
    let not_here = match count(Verdict::NotHere) {
        0 => String::new(),
        n => format!("; {n} cannot be judged, as their scenes do not run on this backend"),
    };
    let (all, cases) = (ok + fail, reports.len());
    say(&format!("{ok} of {all} expectations met in {cases} cases, {}{not_here}", terminal::seconds(seconds)));
    Ok(if fail == 0 { Outcome::Fine } else { Outcome::WentWrong })
}

fn list(cases: &[(String, jetsam::scene::Source)]) -> miette::Result<Outcome> {
    let mut rows = Vec::new();
    for (name, source) in cases {
        let scene = Scene::parse(source.clone(), &[]).map_err(|e| *e)?;
        let quick = scene.validation.is_some_and(|v| v.quick);
        rows.push((name.as_str(), format!("{}{}", scene.title, if quick { "  (quick)" } else { "" })));
    }
    print(&table(&rows));
    Ok(Outcome::Fine)
}

/// Writes a case's plot and readings.
fn write(folder: &Path, report: &Report) -> miette::Result<()> {
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    for (extension, text) in [("svg", report.plot.clone()), ("csv", report.csv())] {
        let path = folder.join(format!("{}.{extension}", report.name));
        std::fs::write(&path, text).map_err(at(&path))?;
    }
    Ok(())
}

/// A case as a table.
fn text(report: &Report) -> String {
    let head = ["", "variant", "what", "reference", "tolerance", "reached", "", ""].map(str::to_owned);
    let line = |r: &Row| {
        let words = [r.verdict.word(), &r.variant, &r.what, &r.reference, &r.tolerance, &r.reached_text()];
        let mut cells: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
        cells.push(format!("{} s", short((10.0 * r.seconds).round() / 10.0)));
        cells.push(r.note.clone());
        cells
    };
    let mut rows: Vec<Vec<String>> = vec![head.to_vec()];
    rows.extend(report.rows.iter().map(line));
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let shown = (0..widths.len()).filter(|&c| rows[1..].iter().any(|r| !r[c].is_empty())).collect::<Vec<_>>();
    let line = |row: &Vec<String>| {
        let cells = shown.iter().map(|&c| format!("{:w$}", row[c], w = widths[c]));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let title = format!("{}: {}", report.name, report.title);
    let body: Vec<String> = rows.iter().map(line).collect();
    format!("{title}\n{}\n", body.join("\n"))
}

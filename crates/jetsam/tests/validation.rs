//! The quick validation cases: every scene of `scenes/validation/` that says `quick = true` is a test.

use jetsam::Scene;
use jetsam::validate::{Verdict, cases, run};
use libtest_mimic::{Arguments, Failed, Trial};

fn main() {
    let mut trials = vec![Trial::test("every case can be read and says where its numbers come from", readable)];
    for (name, source) in cases::select(&[]).expect("the built-in cases are there") {
        let scene = Scene::parse(source.clone(), &[]).unwrap_or_else(|e| panic!("{e}"));
        if !scene.validation.is_some_and(|v| v.quick) {
            continue;
        }
        let judge = move || -> Result<(), Failed> {
            let report = run(&name, &source, &[], jetsam::Choice::Cpu, &mut |_, _| {}).map_err(|e| e.to_string())?;
            let failed = report.rows.iter().filter(|r| r.verdict == Verdict::Fail);
            let said: Vec<String> = failed
                .map(|r| {
                    let (variant, what, reached, note) = (&r.variant, &r.what, r.reached_text(), &r.note);
                    format!("{variant} {what}: {reached}, not {} {} {note}", r.reference, r.tolerance)
                })
                .collect();
            if said.is_empty() { Ok(()) } else { Err(said.join("\n").into()) }
        };
        let title = scene.title;
        trials.push(Trial::test(title, judge));
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// What a report says of a case is written down in the case.
fn readable() -> Result<(), Failed> {
    for (name, source) in cases::select(&[]).map_err(|e| e.to_string())? {
        let scene = Scene::parse(source, &[]).map_err(|e| e.to_string())?;
        let validation = scene.validation.ok_or(format!("{name} has no [validation] table"))?;
        if !name.starts_with(&validation.id) || validation.id.is_empty() || scene.title.is_empty() {
            return Err(format!("{name}: its name does not begin with its id, or it has no title").into());
        }
    }
    Ok(())
}

//! What a case comes out as: rows of a table, as text, JSON and markdown.

use super::Run;
use super::judge::Judge;
use serde::Serialize;
use std::fmt::Write;

/// A judged case.
#[derive(Debug)]
pub struct Report {
    /// Name: that of its file.
    pub name: String,
    /// Number of the case, as in `A5`; may be empty.
    pub id: String,
    /// The scene's title.
    pub title: String,
    /// What a reader should know.
    pub notes: String,
    /// Verdicts.
    pub rows: Vec<Row>,
    /// What was read.
    pub runs: Vec<Run>,
    /// Reference against simulation, as SVG.
    pub plot: String,
    /// Names of the probes, in the order of the runs' series.
    pub probes: Vec<String>,
}

/// One expectation and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the case.
    pub case: String,
    /// Name of the variant; empty where there is none or several are compared.
    pub variant: String,
    /// What was measured.
    pub what: String,
    /// What was expected, if it is one number.
    pub value: Option<f64>,
    /// What was expected, in words.
    pub reference: String,
    /// How far it may be off.
    pub tolerance: String,
    /// What came out; nothing where no such value exists.
    pub reached: Option<f64>,
    /// The verdict.
    pub verdict: Verdict,
    /// Wall-clock time of the runs that the number was taken from (s).
    pub seconds: f64,
    /// Where the expected value comes from.
    pub source: String,
    /// What else is to be said.
    pub note: String,
}

/// Whether an expectation is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It is.
    Ok,
    /// It is not.
    Fail,
    /// It is only reported.
    Info,
    /// The scene cannot run on the backend that was asked for.
    #[serde(rename = "not here")]
    NotHere,
}

impl Verdict {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Ok => "ok",
            Verdict::Fail => "FAIL",
            Verdict::Info => "info",
            Verdict::NotHere => "cannot run here",
        }
    }
}

impl Row {
    /// `ran`: whether the runs behind it could be made.
    pub(super) fn new(
        case: &str,
        variant: &str,
        judge: &Judge,
        number: f64,
        note: String,
        seconds: f64,
        ran: bool,
    ) -> Self {
        let (reference, tolerance) = judge.expected();
        let verdict = match (judge.expect.gate, judge.holds(number)) {
            _ if !ran => Verdict::NotHere,
            (false, _) => Verdict::Info,
            (true, true) => Verdict::Ok,
            (true, false) => Verdict::Fail,
        };
        Self {
            case: case.into(),
            variant: variant.into(),
            what: judge.what(),
            value: judge.value(),
            reference,
            tolerance,
            reached: number.is_finite().then_some(number),
            verdict,
            seconds,
            source: judge.expect.source.clone(),
            note,
        }
    }

    /// What came out, as the table says it.
    pub fn reached_text(&self) -> String {
        self.reached.map_or_else(|| "nothing".into(), short)
    }
}

impl Report {
    /// Whether an expectation that counts is not met.
    pub fn fails(&self) -> bool {
        self.rows.iter().any(|r| r.verdict == Verdict::Fail)
    }

    /// Wall-clock time of all runs (s).
    pub fn seconds(&self) -> f64 {
        self.runs.iter().map(|r| r.seconds).sum()
    }

    /// Every reading of every run: `variant,time,probe,value`.
    pub fn csv(&self) -> String {
        let mut text = String::from("variant,time,probe,value\n");
        for run in &self.runs {
            for (name, s) in self.probes.iter().zip(&run.series) {
                for (t, v) in s.time.iter().zip(&s.value) {
                    writeln!(text, "{},{t},{name},{v}", run.variant).expect("writing to memory");
                }
            }
        }
        text
    }
}

/// All cases as a markdown document; plots are files named after the cases beside it.
pub fn markdown(reports: &[Report], how: &str) -> String {
    let mut text =
        format!("# Validation\n\n{how}\n\n| case | | met | reported only | seconds |\n|---|---|---|---|---|\n");
    let line = "writing to memory";
    for r in reports {
        let count = |v| r.rows.iter().filter(|row| row.verdict == v).count();
        let (ok, fail, info) = (count(Verdict::Ok), count(Verdict::Fail), count(Verdict::Info));
        let met = if ok + fail + info == 0 {
            Verdict::NotHere.word().into()
        } else if fail == 0 {
            format!("{ok} of {ok}")
        } else {
            format!("**{ok} of {}**", ok + fail)
        };
        let link = anchor(&r.name);
        writeln!(text, "| [{}](#{link}) | {} | {met} | {info} | {:.1} |", r.name, r.title, r.seconds()).expect(line);
    }
    for r in reports {
        writeln!(text, "\n## {}\n\n{}", r.name, r.title).expect(line);
        if !r.notes.is_empty() {
            writeln!(text, "\n{}", r.notes.trim()).expect(line);
        }
        let many = r.rows.iter().any(|row| !row.variant.is_empty());
        let (head, rule) = if many { ("| variant ", "|---") } else { ("", "") };
        writeln!(text, "\n{head}| what | reference | tolerance | reached | | seconds | source |").expect(line);
        writeln!(text, "{rule}|---|---|---|---|---|---|---|").expect(line);
        for row in &r.rows {
            let verdict = if row.verdict == Verdict::Fail { "**FAIL**" } else { row.verdict.word() };
            let note = if row.note.is_empty() { String::new() } else { format!(" ({})", row.note) };
            if many {
                write!(text, "| {} ", cell(&row.variant)).expect(line);
            }
            let (what, source) = (cell(&row.what), cell(&row.source));
            let reached = cell(&(row.reached_text() + &note));
            let (reference, tolerance) = (cell(&row.reference), cell(&row.tolerance));
            writeln!(
                text,
                "| {what} | {reference} | {tolerance} | {reached} | {verdict} | {:.1} | {source} |",
                row.seconds
            )
            .expect(line);
        }
        writeln!(text, "\n![{0}]({0}.svg)", r.name).expect(line);
    }
    text
}

/// The link that markdown viewers make of a heading.
fn anchor(name: &str) -> String {
    let kept = name.chars().filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_');
    kept.flat_map(char::to_lowercase).collect()
}

/// Text inside a cell of a markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

/// A number in six significant digits at most.
pub fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x == 0.0 { "0".into() } else { x.to_string() };
    }
    let magnitude = x.abs().log10().floor() as i32;
    if (-4..6).contains(&magnitude) {
        let digits = (5 - magnitude).max(0) as usize;
        let text = format!("{x:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    } else {
        let text = format!("{x:.4e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa =
            if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
        format!("{mantissa}e{exponent}")
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_short() {
        let pairs = [
            (0.0, "0"),
            (1.0, "1"),
            (-9810.0, "-9810"),
            (0.702256, "0.702256"),
            (1.0 / 3.0, "0.333333"),
            (123456.7, "123457"),
            (1.5e-7, "1.5e-7"),
            (2e9, "2e9"),
            (0.00125, "0.00125"),
        ];
        for (x, text) in pairs {
            assert_eq!(super::short(x), text);
        }
    }
}

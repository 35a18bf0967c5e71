//! What `conform` found, as JSON and for people.

use super::oracle::{self, OracleRow};
use crate::subjects::Tested;
use crate::table::{grouped, of_rows, table};
use conformance::leaks;
use serde::Serialize;
use serde_json::{Value, json};

#[derive(Default, Serialize)]
pub(super) struct Report {
    #[serde(flatten)]
    pub(super) tested: Tested,
    pub(super) seed: u64,
    /// Cases that each law was to see.
    pub(super) cases: u32,
    pub(super) leak_rays: u64,
    pub(super) rows: Vec<PropertyRow>,
    /// Rays of one sort at one body, by one backend.
    pub(super) leaks: Vec<Value>,
    /// The first rays that were wrong, each with the command that finds them again.
    pub(super) leak_examples: Vec<String>,
    pub(super) oracle_rays: u64,
    pub(super) oracle: Vec<OracleRow>,
    /// Likewise, rays whose answers are not the oracle's.
    pub(super) oracle_examples: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct PropertyRow {
    pub(super) law: &'static str,
    pub(super) backend: &'static str,
    /// Cases that held, up to the first that did not.
    pub(super) held: u32,
    pub(super) disagreement: Option<String>,
    /// The command that shows it again.
    pub(super) reproduce: Option<String>,
    pub(super) seconds: f64,
}

/// What is told of rays of one sort at one body, in the file and in a table.
const LEAKS: &str = "backend body aim side offset rays leaks counted miscounts";

pub(super) fn leak_row(backend: &str, row: &leaks::LeakRow) -> Value {
    let aim = match row.aim {
        leaks::Aim::Edge => "edge",
        leaks::Aim::Vertex => "vertex",
        leaks::Aim::Random => "random",
    };
    // As few digits as single precision needs.
    let offset: Option<f64> = row.offset.to_string().parse().ok();
    json!({
        "backend": backend,
        "body": row.body,
        "offset": offset,
        "aim": aim,
        "side": if row.inside { "inside" } else { "outside" },
        "rays": row.rays,
        "leaks": row.leaks,
        "counted": row.counted,
        "miscounts": row.miscounts,
    })
}

impl Report {
    /// Laws broken, sorts of rays that leak, and kinds of meshes of which the oracle says otherwise.
    pub(super) fn failures(&self) -> usize {
        let broken = self.rows.iter().filter(|r| r.disagreement.is_some());
        let leaks = |r: &&Value| r["leaks"] != 0 || r["miscounts"] != 0;
        let leaky = self.leaks.iter().filter(leaks);
        let unlike = self.oracle.iter().filter(|r| r.is_failure());
        broken.count() + leaky.count() + unlike.count()
    }

    pub(super) fn text(&self) -> String {
        let mut text = self.tested.text.clone();
        if !self.rows.is_empty() {
            text += &self.law_table();
        }
        if !self.leaks.is_empty() {
            text += &self.leak_table();
        }
        text += &oracle::text(&self.oracle);
        for row in &self.rows {
            if let (Some(what), Some(command)) = (&row.disagreement, &row.reproduce) {
                text += &format!("{}: {what}\n    {command}\n", row.backend);
            }
        }
        for example in self.leak_examples.iter().chain(&self.oracle_examples) {
            text += &format!("{example}\n");
        }
        text
    }

    /// Laws down, backends across.
    fn law_table(&self) -> String {
        let mut head = vec!["law"];
        head.extend(&self.tested.names);
        let mut rows: Vec<Vec<String>> = Vec::new();
        let mut laws = Vec::new();
        for PropertyRow { law, .. } in &self.rows {
            if laws.contains(law) {
                continue;
            }
            laws.push(law);
            let cell = |backend: &&str| {
                let this = |r: &&PropertyRow| (&r.law, &r.backend) == (law, backend);
                match self.rows.iter().find(this) {
                    None => "-".to_owned(),
                    Some(r) if r.disagreement.is_some() => "DISAGREES".to_owned(),
                    Some(r) => format!("held {}", r.held),
                }
            };
            let cells = self.tested.names.iter().map(cell).collect();
            rows.push([vec![law.replace('_', " ")], cells].concat());
        }
        table(&head, &rows, 1)
    }

    fn leak_table(&self) -> String {
        let text = |value: &Value| match value {
            Value::String(text) => text.clone(),
            Value::Number(n) if n.is_u64() => grouped(n.as_u64().unwrap_or(0) as usize),
            other => other.as_f64().unwrap_or(f64::NAN).to_string(),
        };
        let cells = |row: &Value| {
            LEAKS
                .split(' ')
                .map(|name| (name, text(&row[name])))
                .collect()
        };
        of_rows(&self.leaks.iter().map(cells).collect::<Vec<_>>(), 4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(disagreement: Option<&str>) -> Report {
        let row = |backend, law, disagreement: Option<&str>| PropertyRow {
            law,
            backend,
            held: 3,
            disagreement: disagreement.map(str::to_owned),
            reproduce: disagreement.map(|_| "abvh conform --case 3".to_owned()),
            seconds: 0.5,
        };
        let mut tested = Tested::default();
        tested.names.extend(["x", "y"]);
        Report {
            tested,
            // In the order in which they are tried.
            rows: vec![
                row("x", "a_b", None),
                row("x", "c_d", None),
                row("y", "a_b", disagreement),
            ],
            ..Report::default()
        }
    }

    #[test]
    fn a_disagreement_comes_with_the_command_that_shows_it() {
        let text = report(Some("law a_b: 1 is not 2")).text();
        let words = text.split(' ').filter(|word| !word.is_empty());
        let words: Vec<_> = words.collect();
        let text = words.join(" ") + &text;
        for part in [
            "a b held 3 DISAGREES",
            "c d held 3 - ",
            "y: law a_b: 1 is not 2",
            "\n    abvh conform --case 3\n",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!report(None).text().contains("DISAGREES"));
    }

    #[test]
    fn broken_laws_and_leaky_rows_are_failures() {
        assert_eq!(report(None).failures(), 0);
        let mut bad = report(Some("no"));
        let leak = leaks::LeakRow {
            body: "box",
            offset: 10.0,
            aim: leaks::Aim::Edge,
            inside: true,
            rays: 9,
            leaks: 1,
            counted: 2,
            miscounts: 0,
            doubled: 0,
        };
        let tight = leaks::LeakRow { leaks: 0, ..leak };
        bad.leaks = [tight, leak].map(|row| leak_row("x", &row)).to_vec();
        assert_eq!(bad.failures(), 2);
        assert!(bad.text().contains("inside"));
    }
}

//! Doubts about a campaign, those of one kind together: a table is not read below a page of warnings.

use super::Warning;

/// From so many of one kind on they are one line.
const MANY: usize = 3;
/// So many places of a kind are named.
const NAMED: usize = 3;

/// One line for a person.
#[derive(Debug, PartialEq)]
pub struct Line {
    /// Runs and lines, or nothing where it concerns the campaign.
    pub place: String,
    pub message: String,
}

/// The warnings in the order in which their kinds first come.
pub fn grouped(warnings: &[Warning]) -> Vec<Line> {
    let kind = |warning: &Warning| warning.of_many.map_or_else(|| warning.message.clone(), str::to_owned);
    let mut groups: Vec<(String, Vec<&Warning>)> = Vec::new();
    for warning in warnings {
        let kind = kind(warning);
        match groups.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, group)) => group.push(warning),
            None => groups.push((kind, vec![warning])),
        }
    }
    let lines = |(kind, group): (String, Vec<&Warning>)| match group.len() < MANY {
        true => group.iter().map(|each| Line { place: place(each), message: each.message.clone() }).collect(),
        false => {
            let mut places: Vec<String> = group.iter().take(NAMED).map(|each| places(each)).collect();
            if group.len() > NAMED {
                places.push(format!("{} more", group.len() - NAMED));
            }
            vec![Line { place: places.join("; "), message: kind }]
        }
    };
    groups.into_iter().flat_map(lines).collect()
}

/// With the other run, where there is one: the message of many does not name it.
fn places(warning: &Warning) -> String {
    let place = place(warning);
    warning.other.as_ref().map_or_else(|| place.clone(), |other| format!("{other} and {place}"))
}

fn place(warning: &Warning) -> String {
    match (&warning.run, warning.line) {
        (Some(run), Some(line)) => format!("{run}, line {line}"),
        (Some(run), None) => run.clone(),
        (None, _) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_of_a_kind_are_one_line() {
        let jump = |line| Warning::of_run("runs/001.csv", "the rate jumps").at_line(line);
        let gap = |file, message: &str| Warning { of_many: Some("a gap"), ..Warning::of_run(file, message) };
        let mut warnings = vec![Warning::of_campaign("few runs".into()), gap("a.csv", "a gap of 2 s")];
        warnings.extend((5..27).map(jump));
        let lines = grouped(&warnings);
        let line = |place: &str, message: &str| Line { place: place.into(), message: message.into() };
        let jumps = "runs/001.csv, line 5; runs/001.csv, line 6; runs/001.csv, line 7; 19 more";
        assert_eq!(lines, [line("", "few runs"), line("a.csv", "a gap of 2 s"), line(jumps, "the rate jumps")]);
        let gaps = [gap("a.csv", "a gap of 2 s"), gap("b.csv", "a gap of 3 s"), gap("c.csv", "a gap of 4 s")];
        assert_eq!(grouped(&gaps), [line("a.csv; b.csv; c.csv", "a gap")]);
        let overlap = |other: &str, file: &str| Warning {
            of_many: Some("they overlap"),
            other: Some(other.into()),
            ..Warning::of_run(file, format!("it holds a stretch of {other}"))
        };
        let pairs = [overlap("1.csv", "2.csv"), overlap("1.csv", "3.csv"), overlap("2.csv", "3.csv")];
        assert_eq!(grouped(&pairs), [line("1.csv and 2.csv; 1.csv and 3.csv; 2.csv and 3.csv", "they overlap")]);
        assert_eq!(grouped(&pairs[..1]), [line("2.csv", "it holds a stretch of 1.csv")]);
    }
}

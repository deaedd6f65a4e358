//! A recording's beginning as numbers, and what stands around them.

use std::collections::HashMap;

use crate::import::moment;

/// Lines by which the delimiter is told.
const LINES: usize = 1000;
/// How numbers may be written: what lies between them, and whether they have decimal commas. The first that reads the most lines is taken.
const STYLES: [(&str, bool); 7] =
    [(";", true), ("\t", true), (";", false), ("\t", false), (",", false), (" ", true), (" ", false)];

/// So many bad rows are named.
const NAMED: usize = 5;
/// So much of a field that is no number is repeated.
const LONGEST_FIELD: usize = 20;

/// The recording's head as numbers.
pub struct Table {
    pub delimiter: &'static str,
    pub comment: char,
    pub decimal_comma: bool,
    /// Lines before the data, empty ones too.
    pub header_rows: usize,
    /// Which of them names the columns, from 1, where it is not the last.
    pub names_row: Option<usize>,
    /// Lines after the data that are neither empty nor comments.
    pub footer_rows: usize,
    /// Empty where the header has none.
    pub names: Vec<String>,
    /// Of a row of units below the names.
    units: Vec<String>,
    pub columns: Vec<Vec<f64>>,
    /// The first column of dates with times, in seconds.
    pub moments: Option<usize>,
    /// Lines among the data that are no rows of numbers, and what is wrong with them.
    bad: Vec<(usize, String)>,
    /// How many rows the whole file has, about.
    pub rows_of_file: f64,
}

impl Table {
    /// From the file's first and last bytes, and how many it has where these are not all. `None`: no rows of numbers.
    pub fn read(head: &str, tail: &str, longer: Option<u64>) -> Option<Self> {
        let cut = longer.is_some();
        // The last line may be cut off by the limit of what is looked at.
        let whole = if cut { head.rfind('\n').map_or(head, |end| &head[..end]) } else { head };
        let first = whole.lines().map(bare).find(|line| !line.is_empty())?;
        let comment = ['#', '%', '!'].into_iter().find(|&mark| first.starts_with(mark)).unwrap_or('#');
        // An empty line below a comment belongs to it; others are rows of the header.
        let mut below_comment = false;
        let is_row = |(_, line): &(usize, &str)| {
            let is_comment = line.starts_with(comment);
            below_comment = is_comment || (line.is_empty() && below_comment);
            !(is_comment || line.is_empty() && below_comment)
        };
        let numbered: Vec<(usize, &str)> = (1..).zip(whole.lines().map(bare)).filter(is_row).collect();
        let lines: Vec<&str> = numbered.iter().map(|(_, line)| *line).collect();
        let (style, width) = style(&lines)?;
        let header_rows = lines.iter().take_while(|line| row(line, style, width).is_none()).count();
        let Header { names, units, names_row } = Header::read(&lines[..header_rows], style, width);
        let ends = tail.lines().skip(usize::from(cut)).map(bare);
        let ends: Vec<&str> = ends.filter(|line| !line.is_empty() && !line.starts_with(comment)).collect();
        let footer_rows = ends.iter().rev().take_while(|line| row(line, style, width).is_none()).count();
        let footer_rows = if footer_rows < ends.len() { footer_rows } else { 0 };
        let mut data: Vec<(usize, &str)> =
            numbered[header_rows..].iter().copied().filter(|(_, line)| !line.is_empty()).collect();
        if !cut {
            data.truncate(data.len().saturating_sub(footer_rows));
        }
        let (mut columns, mut bad) = (vec![Vec::new(); width], Vec::new());
        for (number, line) in &data {
            match row(line, style, width) {
                Some(values) => columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value)),
                None => bad.push((*number, wrong(line, style, width))),
            }
        }
        let rows = columns.first().map(Vec::len).filter(|rows| *rows > 0)?;
        let data_bytes: usize = data.iter().map(|(_, line)| line.len() + 1).sum();
        let of_first = lines.get(header_rows).map(|line| split(line, style.0)).unwrap_or_default();
        let moments = of_first.iter().position(|field| moment::seconds(field).is_some());
        Some(Self {
            delimiter: style.0,
            comment,
            decimal_comma: style.1,
            header_rows,
            names_row,
            footer_rows,
            names,
            units,
            columns,
            moments,
            bad,
            rows_of_file: longer.map_or(1.0, |bytes| bytes as f64 / data_bytes as f64) * rows as f64,
        })
    }

    /// Which lines among the data are no rows of numbers, for a person.
    pub fn bad_rows(&self) -> Option<String> {
        let named: Vec<String> =
            self.bad.iter().take(NAMED).map(|(line, what)| format!("line {line} ({what})")).collect();
        let more = self.bad.len() - named.len();
        let others = if more > 0 { format!(" and {more} more") } else { String::new() };
        (!named.is_empty()).then(|| named.join(", ") + &others)
    }

    /// A column as a mapping names it.
    pub fn name(&self, column: usize) -> String {
        match self.names.get(column) {
            Some(name) if self.names.iter().filter(|each| *each == name).count() == 1 => format!("{name:?}"),
            _ => (column + 1).to_string(),
        }
    }

    /// Its name and, where it stands in a row of its own, its unit, in lower case; empty without one.
    pub fn described(&self, column: usize) -> String {
        let of = |texts: &[String]| {
            texts.get(column).map(|text| text.to_lowercase().replace('°', "deg")).unwrap_or_default()
        };
        format!("{} {}", of(&self.names), of(&self.units)).trim().to_owned()
    }

    pub fn mean(&self, column: usize) -> f64 {
        self.columns[column].iter().sum::<f64>() / self.columns[column].len() as f64
    }

    /// Length of the vector of some columns' means.
    pub fn norm(&self, columns: &[usize]) -> f64 {
        columns.iter().map(|&column| self.mean(column).powi(2)).sum::<f64>().sqrt()
    }

    pub fn median_step(&self, column: usize) -> f64 {
        let mut steps: Vec<f64> = self.columns[column].windows(2).map(|pair| pair[1] - pair[0]).collect();
        quantities::median::median(&mut steps).unwrap_or(0.0)
    }
}

/// How the numbers are written, and how many stand in a line: what reads the most lines; a single column only where nothing else reads any.
fn style(lines: &[&str]) -> Option<((&'static str, bool), usize)> {
    let middle = lines.len() / 2;
    let looked_at = &lines[middle.saturating_sub(LINES / 2)..(middle + LINES / 2).min(lines.len())];
    let read = |style: (&str, bool)| {
        let mut widths: HashMap<usize, usize> = HashMap::new();
        for line in looked_at {
            let fields = split(line, style.0);
            let commas = !style.1 || fields.iter().any(|field| field.contains(','));
            if commas && fields.iter().all(|field| number(field, style.1).is_some()) {
                *widths.entry(fields.len()).or_default() += 1;
            }
        }
        widths
    };
    let several = STYLES.into_iter().rev().filter_map(|style| {
        let widest = read(style).into_iter().filter(|(width, _)| *width > 1).max_by_key(|(_, count)| *count)?;
        Some((style, widest))
    });
    let best = several.max_by_key(|(_, (_, count))| *count).map(|(style, (width, _))| (style, width));
    best.or_else(|| read((",", false)).contains_key(&1).then_some(((",", false), 1)))
}

/// A line without the blanks around it; a tab may stand before or after an empty field.
fn bare(line: &str) -> &str {
    line.trim_matches([' ', '\r'])
}

/// A line of that many numbers.
fn row(line: &str, style: (&str, bool), width: usize) -> Option<Vec<f64>> {
    let fields = split(line, style.0);
    (fields.len() == width).then(|| fields.iter().map(|field| number(field, style.1)).collect())?
}

/// Why a line is no row of that many numbers.
fn wrong(line: &str, style: (&str, bool), width: usize) -> String {
    let fields = split(line, style.0);
    match fields.iter().find(|field| number(field, style.1).is_none()) {
        _ if fields.len() != width => format!("{} fields, not {width}", fields.len()),
        Some(field) => format!("{:?}", field.chars().take(LONGEST_FIELD).collect::<String>()),
        None => "no row of numbers".into(),
    }
}

/// What the header says.
#[derive(Default)]
struct Header {
    names: Vec<String>,
    units: Vec<String>,
    names_row: Option<usize>,
}

impl Header {
    /// The last row with anything in it names the columns, or, where it holds nothing but units, the one before.
    fn read(header: &[&str], style: (&str, bool), width: usize) -> Self {
        let fields = |line: &str| -> Vec<String> { split(line, style.0).into_iter().map(str::to_owned).collect() };
        let filled = header.iter().enumerate().filter(|(_, line)| !line.is_empty());
        let mut rows = filled.map(|(row, line)| (row + 1, fields(line))).rev();
        let Some((_, last)) = rows.next().filter(|(_, last)| last.len() == width) else { return Self::default() };
        match rows.next().filter(|(_, before)| before.len() == width) {
            Some((row, names)) if last.iter().all(|field| is_unit(field)) => {
                Self { names, units: last, names_row: Some(row) }
            }
            _ => Self { names: last, ..Self::default() },
        }
    }
}

/// What stands in a row of units.
fn is_unit(field: &str) -> bool {
    const UNITS: [&str; 23] = [
        "", "-", "s", "ms", "us", "ns", "h", "min", "deg", "rad", "arcsec", "deg/s", "deg/h", "rad/s", "dps", "g",
        "mg", "m/s2", "m/s^2", "degc", "k", "v", "hz",
    ];
    let bare = field.trim_matches(['[', ']', '(', ')']).replace('°', "deg").replace('²', "2").to_lowercase();
    UNITS.contains(&bare.as_str())
}

pub fn split<'a>(line: &'a str, delimiter: &str) -> Vec<&'a str> {
    match delimiter {
        " " => line.split_whitespace().collect(),
        delimiter => line.split(delimiter).map(|field| field.trim().trim_matches('"')).collect(),
    }
}

fn number(field: &str, decimal_comma: bool) -> Option<f64> {
    let value = if decimal_comma { field.replacen(',', ".", 1).parse::<f64>() } else { field.parse::<f64>() };
    value.ok().filter(|value| value.is_finite()).or_else(|| moment::seconds(field))
}

//! `report.html`: a run at a glance, in one file that needs no network.
//!
//! The first screen says what was run, how many members relaxed, how long they took and what went wrong. Pictures,
//! tables, the spec and the provenance follow. All text is escaped, a content security policy forbids every request and
//! every script except that of the slider, and equal pages have equal bytes. For a run of any size, a page holds a few
//! members, the pictures and the first rows of each table.

mod player;
mod scope;

pub use player::{MAX_MEMBERS, MovingMember, spread};

use curvelax_base::text::{count, grouped};
use curvelax_draw::{
    chart::{Entry, sample},
    empty::reason,
    svg::escape,
};
use player::{Player, colour};
use scope::Sheets;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Its digest, by which the content security policy allows this script only. A test computes it.
const SCRIPT_DIGEST: &str = "sha256-p2hBubjQGTLFJE1JTm08jX46zORurr4BSUyOICPJ1sg=";

/// Longer tables are truncated, and say so.
const MAX_ROWS: usize = 200;
/// Tables with at most this many rows, and more columns than [`NARROW`], are turned: they fit a phone then.
const FEW_ROWS: usize = 3;
/// Tables with more rows are folded.
const UNFOLDED: usize = 12;
const NARROW: usize = 8;

/// What a page says first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageHead {
    /// Heading, and title of the window.
    pub title: String,
    /// A sentence or two on what was run.
    pub what: String,
    /// Members by status, such as `("relaxed", 412)`.
    pub statuses: Vec<(&'static str, u64)>,
    /// Of those that vanished, the members that had relaxed.
    pub relaxed_before: u64,
    /// The numbers to read first: how long relaxation took.
    pub headline: Vec<Headline>,
}

/// The content of a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page<'a> {
    /// What it says first.
    pub head: PageHead,
    /// The numbers to read first are those of members, in a list.
    pub is_list: bool,
    /// What the reader should know, one sentence each.
    pub warnings: &'a [String],
    /// A few members to watch; the first [`MAX_MEMBERS`] are shown.
    pub members: Vec<MovingMember>,
    /// What the clock of the members shows, if that needs a word.
    pub clock: &'a str,
    /// Units of length and time, each after a space; may be empty.
    pub units: [String; 2],
    /// The legend of all pictures.
    pub legend: &'a [Entry],
    /// The pictures.
    pub plots: Vec<PageFigure>,
    /// The tables.
    pub tables: Vec<PageTable>,
    /// The resolved spec as TOML.
    pub spec: &'a str,
    /// How and when it was made: name and value.
    pub provenance: Vec<(String, String)>,
}

/// A prominent number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Headline {
    /// Its name: `median t_relax`.
    pub label: String,
    /// The number as people write it, with its unit.
    pub value: String,
    /// Its interval, or another note; may be empty.
    pub note: String,
}

/// A picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageFigure {
    /// Its file in the folder of the run.
    pub name: &'static str,
    /// Its title for screen readers; the picture shows it, too.
    pub title: String,
    /// A sentence below it; may be empty.
    pub caption: String,
    /// The text of an SVG file by this program: it is not escaped.
    pub svg: String,
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageTable {
    /// What it holds, in a few words.
    pub caption: String,
    /// How it is read; may be empty.
    pub note: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells as shown. Columns of numbers are aligned at the right.
    pub rows: Vec<Vec<String>>,
    /// The file with all rows and digits, in the folder of the page; may be empty.
    pub source: String,
}

impl Page<'_> {
    /// The text of the file.
    pub fn html(&self) -> String {
        let player = Player::new(&self.members, &self.units);
        let script = player.as_ref().filter(|player| player.moves()).map(|player| script(&player.data()));
        let mut sheets = Sheets::default();
        let plots = self.pictures(&mut sheets);
        let tables: String = self.tables.iter().map(PageTable::html).collect();
        let spec = format!("<pre><code>{}</code></pre>\n", escape(self.spec));
        let fact = |(name, value): &(String, String)| format!("<dt>{}</dt><dd>{}</dd>\n", escape(name), escape(value));
        let facts: String = self.provenance.iter().map(fact).collect();
        let sections = [
            ("plots", "Plots", plots),
            ("tables", "Tables", tables),
            ("spec", "Spec", spec),
            ("provenance", "Provenance", format!("<dl class=\"facts\">\n{facts}</dl>\n")),
        ];
        let sections: Vec<_> = sections.into_iter().filter(|(.., content)| !content.is_empty()).collect();

        let mut html = head(&self.head.title, script.is_some(), &sheets.text());
        html += &format!("<header>\n<h1>{}</h1>\n", escape(&self.head.title));
        html += &paragraph("what", &self.head.what);
        let links = sections.iter().map(|(id, name, _)| format!("<li><a href=\"#{id}\">{name}</a></li>\n"));
        html += &format!(
            "<nav aria-label=\"Sections\">\n<ul>\n{}</ul>\n</nav>\n</header>\n<main>\n",
            links.collect::<String>()
        );
        html += &self.first_screen(player.as_ref());
        for (id, name, content) in &sections {
            html += &format!("<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{name}</h2>\n{content}</section>\n");
        }
        html + "</main>\n" + &script.unwrap_or_default() + "</body>\n</html>\n"
    }

    fn first_screen(&self, player: Option<&Player>) -> String {
        let alone = if player.is_none() { " alone" } else { "" };
        let mut html = format!("<div class=\"first{alone}\">\n<div>\n");
        html += &section("How many relaxed", "", &self.counts());
        if !self.head.headline.is_empty() {
            let tiles: String = self.head.headline.iter().map(Headline::html).collect();
            let class = if self.is_list { "headline list" } else { "headline" };
            html += &section("How long it took", "", &format!("<dl class=\"{class}\">\n{tiles}</dl>\n"));
        }
        html += &section("What went wrong", "wrong", &self.wrong());
        html += "</div>\n";
        if let Some(player) = player {
            html += &format!(
                "<div>\n{}</div>\n",
                section("Members over time", "", &(player.html() + &paragraph("note", self.clock)))
            );
        }
        html + "</div>\n"
    }

    /// The pictures, below their legend. Of those in which there is nothing to draw, only the reasons are left.
    fn pictures(&self, sheets: &mut Sheets) -> String {
        let (empty, drawn): (Vec<_>, Vec<_>) = self.plots.iter().partition(|figure| reason(&figure.svg).is_some());
        let figures: String = drawn.iter().map(|figure| figure.html(sheets)).collect();
        let figures = if figures.is_empty() { figures } else { format!("<div class=\"plots\">\n{figures}</div>\n") };
        let why = |figure: &&PageFigure| {
            let reason = reason(&figure.svg).unwrap_or_default();
            format!("<li>{}: {reason}</li>\n", escape(&figure.title))
        };
        let without: String = empty.iter().map(why).collect();
        let without = match without.is_empty() {
            true => without,
            false => format!("<div class=\"small\">Nothing to draw:\n<ul>\n{without}</ul></div>\n"),
        };
        let entry = |entry: &Entry| {
            let sample = sheets.inlined(&sample(entry)).replacen(" role=\"img\"", " aria-hidden=\"true\"", 1);
            format!("<li>{sample}{}</li>\n", escape(&entry.label))
        };
        let entries: String = self.legend.iter().map(entry).collect();
        let legend = match entries.is_empty() || drawn.is_empty() {
            true => String::new(),
            false => format!("<ul class=\"legend\" aria-label=\"Legend of all plots\">\n{entries}</ul>\n"),
        };
        legend + &figures + &without
    }

    /// Number of members with this status.
    fn with(&self, status: &str) -> u64 {
        self.head.statuses.iter().filter(|(name, _)| *name == status).map(|(_, count)| count).sum()
    }

    fn all(&self) -> u64 {
        self.head.statuses.iter().map(|(_, count)| count).sum()
    }

    fn counts(&self) -> String {
        let (relaxed, all) = (self.with("relaxed") + self.head.relaxed_before, self.all());
        if all == 0 {
            return paragraph("relaxed-count", "There are no members.");
        }
        let mut html = format!(
            "<p class=\"relaxed-count\"><strong>{}</strong> of {} relaxed ({})</p>\n",
            grouped(relaxed),
            count(all, "member"),
            share(relaxed, all)
        );
        let shown = || self.head.statuses.iter().filter(|(_, count)| *count > 0);
        let bars = shown()
            .map(|(name, count)| format!("<span class=\"{}\" style=\"flex-grow: {count}\"></span>", colour(name)));
        html += &format!(
            "<div class=\"statuses\" aria-hidden=\"true\">{}</div>\n<ul class=\"key\">\n",
            bars.collect::<String>()
        );
        for (name, count) in shown() {
            let (colour, share) = (colour(name), share(*count, all));
            html += &format!("<li><i class=\"{colour}\"></i>{} {} ({share})</li>\n", escape(name), grouped(*count));
        }
        html + "</ul>\n"
    }

    fn wrong(&self) -> String {
        if !self.warnings.is_empty() {
            let items = self.warnings.iter().map(|warning| format!("<li>{}</li>\n", with_code(warning)));
            return format!("<ul>\n{}</ul>\n", items.collect::<String>());
        }
        let [unfinished, relaxed, vanished] = ["unfinished", "relaxed", "vanished"].map(|status| self.with(status));
        let (bad, relaxed) = (self.all() - unfinished - relaxed - vanished, relaxed + self.head.relaxed_before);
        paragraph(
            "",
            &match (bad, unfinished) {
                (0, 0) if relaxed > 0 && relaxed == self.all() => {
                    "Nothing: every member relaxed, and there are no warnings.".into()
                }
                (0, 0) => "Nothing: there are no warnings.".into(),
                (0, _) => format!(
                    "Nothing: no member failed, and there are no warnings. {} had not relaxed when time was up, and \
                     count as censored.",
                    count(unfinished, "member")
                ),
                _ => format!("{} failed: see the statuses.", count(bad, "member")),
            },
        )
    }
}

impl Headline {
    /// A number with its name and a note.
    pub fn new(label: impl Into<String>, value: impl Into<String>, note: impl Into<String>) -> Headline {
        Headline { label: label.into(), value: value.into(), note: note.into() }
    }

    fn html(&self) -> String {
        let [label, value, note] = [&self.label, &self.value, &self.note].map(|text| escape(text));
        let note = if note.is_empty() { note } else { format!("<dd class=\"note\">{note}</dd>") };
        format!("<div><dt>{label}</dt><dd class=\"value\">{value}</dd>{note}</div>\n")
    }
}

impl PageFigure {
    fn html(&self, sheets: &mut Sheets) -> String {
        let caption = escape(&self.caption);
        let caption = if caption.is_empty() { caption } else { format!("<figcaption>{caption}</figcaption>\n") };
        let svg = sheets.inlined(&self.svg);
        format!("<figure>\n<h3 class=\"unseen\">{}</h3>\n{svg}{caption}</figure>\n", escape(&self.title))
    }
}

impl PageTable {
    /// The same table without columns in which nothing is known, or no member was counted.
    #[must_use]
    pub fn without_empty_columns(self) -> PageTable {
        let PageTable { caption, note, header, rows, source } = self;
        let statuses = ["unfinished", "singular", "nonfinite", "stalled", "vanished"];
        let is_kept = |j: usize| {
            let nothing = |text: &str| text.is_empty() || text == "0" && statuses.contains(&&*header[j]);
            rows.is_empty() || !rows.iter().all(|row| row.get(j).is_none_or(|text| nothing(text)))
        };
        let kept: Vec<bool> = (0..header.len()).map(is_kept).collect();
        let of = |cells: Vec<String>| {
            cells.into_iter().zip(&kept).filter(|(_, kept)| **kept).map(|(text, _)| text).collect()
        };
        PageTable { caption, note, rows: rows.into_iter().map(of).collect(), source, header: of(header) }
    }

    fn html(&self) -> String {
        let (class, rows) = match self.rows.len() <= FEW_ROWS && self.header.len() > NARROW {
            true => ("table turned", self.turned()),
            false => ("table", self.upright()),
        };
        let (caption, note, link) = (escape(&self.caption), paragraph("small", &self.note), self.link());
        let table = format!(
            "<div class=\"{class}\" role=\"region\" aria-label=\"{caption}\" tabindex=\"0\">\n\
             <p class=\"title\">{caption}</p>\n{note}<table>\n{rows}</tbody>\n</table>\n{link}</div>\n"
        );
        if self.rows.len() <= UNFOLDED {
            return table;
        }
        let count = grouped(self.rows.len() as u64);
        format!("<details>\n<summary>{caption} ({count} rows)</summary>\n{table}</details>\n")
    }

    /// A row for each column, and a column for each row.
    fn turned(&self) -> String {
        let row = |(j, name): (usize, &String)| {
            let cells = self.rows.iter().map(|row| format!("<td class=\"number\">{}</td>", cell(row, j)));
            format!("<tr><th scope=\"row\">{}</th>{}</tr>\n", escape(name), cells.collect::<String>())
        };
        "<tbody>\n".to_string() + &self.header.iter().enumerate().map(row).collect::<String>()
    }

    /// Where all rows are, with all digits.
    fn link(&self) -> String {
        let source = escape(&self.source);
        let cut = match self.rows.len() > MAX_ROWS {
            true => format!("The first {MAX_ROWS} of {} rows. ", grouped(self.rows.len() as u64)),
            false => String::new(),
        };
        match source.is_empty() && cut.is_empty() {
            true => String::new(),
            false if source.is_empty() => format!("<p class=\"small\">{}</p>\n", cut.trim_end()),
            false => format!("<p class=\"small\">{cut}All numbers: <a href=\"{source}\">{source}</a></p>\n"),
        }
    }

    fn upright(&self) -> String {
        let columns = self.header.len();
        let is_number = |text: &str| text.is_empty() || number(text);
        let numbers: Vec<bool> =
            (0..columns).map(|j| self.rows.iter().all(|row| row.get(j).is_none_or(|text| is_number(text)))).collect();
        let of = |row: &[String], j: usize, tag: &str, scope: &str| {
            let class = if numbers[j] { " class=\"number\"" } else { "" };
            format!("<{tag}{scope}{class}>{}</{tag}>", cell(row, j))
        };
        let head: String = (0..columns).map(|j| of(&self.header, j, "th", " scope=\"col\"")).collect();
        let row = |row: &Vec<String>| {
            let cells = (0..columns).map(|j| match j {
                0 => of(row, j, "th", " scope=\"row\""),
                _ => of(row, j, "td", ""),
            });
            format!("<tr>{}</tr>\n", cells.collect::<String>())
        };
        let rows: String = self.rows.iter().take(MAX_ROWS).map(row).collect();
        format!("<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}")
    }
}

/// The text of a cell; none where a row is short.
fn cell(row: &[String], j: usize) -> String {
    escape(row.get(j).map_or("", String::as_str))
}

/// Whether a cell is a number: plain, with a power of ten, or a bound.
fn number(text: &str) -> bool {
    let text = text.trim_start_matches("≥ ").replace('\u{2212}', "-");
    let mantissa = text.split_once("·10").map_or(&text[..], |(mantissa, _)| mantissa);
    mantissa.parse::<f64>().is_ok()
}

/// Everything up to the body.
fn head(title: &str, script: bool, sheets: &str) -> String {
    let script = if script { format!("'{SCRIPT_DIGEST}'") } else { "'none'".into() };
    let title = escape(title);
    // The empty icon keeps browsers from requesting one.
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
         script-src {script}; img-src data:; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n<style>\n{STYLE}{sheets}</style>\n</head>\n<body>\n"
    )
}

/// The script and its data.
fn script(data: &str) -> String {
    format!("<script type=\"application/json\" id=\"trajectories\">\n{data}\n</script>\n<script>{}</script>\n", code())
}

/// The script as browsers see it: they drop carriage returns before they compute its digest.
fn code() -> String {
    SCRIPT.replace('\r', "")
}

fn section(heading: &str, class: &str, content: &str) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!("<section{class}>\n<h2>{heading}</h2>\n{content}</section>\n")
}

fn paragraph(class: &str, text: &str) -> String {
    match (class, text) {
        (_, "") => String::new(),
        ("", text) => format!("<p>{}</p>\n", escape(text)),
        (class, text) => format!("<p class=\"{class}\">{}</p>\n", escape(text)),
    }
}

/// A warning with what is typed in it as code, which is not broken into lines: flags, and names between backticks.
fn with_code(text: &str) -> String {
    let quoted = text.split('`').enumerate().map(|(i, part)| match i % 2 {
        1 => format!("<code>{}</code>", escape(part)),
        _ => {
            let word = |word: &str| match word.trim_end_matches([',', ';', ':', '.', ')']) {
                flag if flag.starts_with("--") => {
                    format!("<code>{}</code>{}", escape(flag), escape(&word[flag.len()..]))
                }
                _ => escape(word),
            };
            part.split(' ').map(word).collect::<Vec<_>>().join(" ")
        }
    });
    quoted.collect()
}

/// A percentage; 0 means none and 100 means all.
fn share(part: u64, all: u64) -> String {
    let percent = 100.0 * part as f64 / all.max(1) as f64;
    match part {
        _ if part > 0 && percent < 0.05 => "< 0.1 %".into(),
        _ if part < all && percent >= 99.95 => "> 99.9 %".into(),
        _ => format!("{percent:.1} %"),
    }
}

#[cfg(test)]
mod tests;

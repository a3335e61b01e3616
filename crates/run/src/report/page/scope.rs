//! Pictures inside a page. Style sheets apply to the whole page, so each is restricted to the pictures it came with,
//! and equal ones are stored once.

use std::fmt::Write;

/// The style sheets of the pictures on a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheets {
    sheets: Vec<String>,
}

impl Sheets {
    /// The text of an SVG file as part of the page. Its title becomes a label: as a title it would pop up wherever the
    /// pointer rests.
    pub fn inlined(&mut self, svg: &str) -> String {
        let (sheet, svg) = without(svg, "style");
        let (title, mut svg) = without(&svg, "title");
        let label = title.map_or(String::new(), |title| format!(" aria-label=\"{title}\""));
        let class = sheet.map_or(String::new(), |sheet| format!(" class=\"{}\"", self.class(&sheet)));
        if let Some(at) = svg.find("<svg") {
            svg.insert_str(at + 4, &(class + &label));
        }
        svg
    }

    /// All style sheets, restricted.
    pub fn text(&self) -> String {
        self.sheets.iter().enumerate().map(|(i, sheet)| confined(sheet, &name(i))).collect()
    }

    fn class(&mut self, sheet: &str) -> String {
        let known = self.sheets.iter().position(|other| other == sheet);
        name(known.unwrap_or_else(|| {
            self.sheets.push(sheet.into());
            self.sheets.len() - 1
        }))
    }
}

fn name(i: usize) -> String {
    format!("sheet-{i}")
}

/// The content of the first element called `name`, which has no attributes, and `svg` without it.
fn without(svg: &str, name: &str) -> (Option<String>, String) {
    let (open, close) = (format!("<{name}>"), format!("</{name}>"));
    let Some(start) = svg.find(&open) else { return (None, svg.into()) };
    let Some(length) = svg[start..].find(&close) else { return (None, svg.into()) };
    let content = svg[start + open.len()..start + length].to_owned();
    let rest = svg[start + length + close.len()..].trim_start_matches('\n');
    (Some(content), svg[..start].to_owned() + rest)
}

/// `sheet` with each selector restricted to elements inside one of this class. Rules may be inside media queries; there
/// are no comments or strings.
fn confined(sheet: &str, class: &str) -> String {
    let mut text = String::new();
    let mut rest = sheet;
    while let Some(at) = rest.find(['{', '}']) {
        let (before, brace) = (rest[..at].trim(), &rest[at..=at]);
        rest = &rest[at + 1..];
        // Writing into a string cannot fail.
        let _ = match (brace, before.starts_with('@')) {
            ("}", _) => writeln!(text, "}}"),
            (_, true) => writeln!(text, "{before} {{"),
            _ => {
                let selectors: Vec<String> = before.split(',').map(|one| format!(".{class} {}", one.trim())).collect();
                let (rule, after) = rest.split_once('}').unwrap_or((rest, ""));
                rest = after;
                writeln!(text, "{} {{ {} }}", selectors.join(", "), rule.trim())
            }
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const SVG: &str = "<svg xmlns=\"x\">\n<title>a &quot;b&quot;</title>\n<style>\ntext { fill: red }\n.a, .b path { r: 1 } .c { r: 2 }\n\
        @media screen and (x: y) {\ntext { fill: blue }\n}\n</style>\n<text>t</text>\n</svg>\n";

    #[test]
    fn a_sheet_holds_for_its_own_pictures() {
        let mut sheets = Sheets::default();
        let inlined = sheets.inlined(SVG);
        assert_eq!(
            inlined,
            "<svg class=\"sheet-0\" aria-label=\"a &quot;b&quot;\" xmlns=\"x\">\n<text>t</text>\n</svg>\n"
        );
        let expected = "\
.sheet-0 text { fill: red }
.sheet-0 .a, .sheet-0 .b path { r: 1 }
.sheet-0 .c { r: 2 }
@media screen and (x: y) {
.sheet-0 text { fill: blue }
}
";
        assert_eq!(sheets.text(), expected);
    }

    #[test]
    fn equal_sheets_are_kept_once() {
        let mut sheets = Sheets::default();
        let pictures = [SVG.into(), SVG.into(), SVG.replace("red", "green")].map(|svg: String| sheets.inlined(&svg));
        let classes = pictures.map(|svg| svg[12..19].to_owned());
        assert_eq!(classes, ["sheet-0", "sheet-0", "sheet-1"]);
        assert_eq!(sheets.text().matches("fill: blue").count(), 2);
    }

    #[test]
    fn a_picture_without_a_sheet_stays_as_it_is() {
        let mut sheets = Sheets::default();
        assert_eq!(sheets.inlined("<svg></svg>"), "<svg></svg>");
        assert_eq!(sheets.text(), "");
    }
}

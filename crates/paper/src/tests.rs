//! Sizes, letters and bytes of pictures for papers.

#[path = "../../draw/src/charts/tests/samples.rs"]
mod samples;

use super::*;
use curvelax_draw::{
    medium::Medium,
    svg::Svg,
    width::{SIZE, width},
};
use samples::draw_all;

/// A picture of that width with one line of text.
fn written(text: &str, mm: PaperWidth) -> Print {
    let mut svg = Svg::new(mm.pixels(), 60.0, "text { font-family: sans-serif; font-size: 12px; fill: #24292f }", "a");
    svg.text("middle", [20.0, 40.0].into(), text);
    Printer::default().read("Words", &svg.finish(), mm).unwrap()
}

fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// What the compressed streams of a PDF hold: the first is the page.
fn streams(pdf: &[u8]) -> Vec<String> {
    let mut streams = Vec::new();
    let mut rest = pdf;
    while let Some(at) = rest.windows(8).position(|word| word == b"\nstream\n") {
        rest = &rest[at + 8..];
        let mut text = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::ZlibDecoder::new(rest), &mut text).unwrap();
        streams.push(String::from_utf8_lossy(&text).into_owned());
    }
    streams
}

/// The rows of a PNG file, of 3 bytes for each pixel.
fn pixels(png: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

#[test]
fn pixels_are_those_of_the_width_at_the_density_which_the_file_tells() {
    for (width, dpi, dots) in [("column", 600, 2008), ("page", 300, 2008), ("100", 127, 500)] {
        let png = written("a", width.parse().unwrap()).file(PaperFormat::png(dpi).unwrap()).unwrap();
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
        assert_eq!(number(&png, 16), dots, "{width}");
        let place = png.windows(4).position(|name| name == b"pHYs").unwrap() + 4;
        assert_eq!(number(&png, place), (dpi as f64 / 0.0254).round() as u32);
    }
}

#[test]
fn letters_are_drawn_and_those_that_the_font_lacks_are_listed() {
    let dark = |text: &str| {
        let print = written(text, PaperWidth::default());
        let png = print.file(PaperFormat::png(300).unwrap()).unwrap();
        (pixels(&png).iter().filter(|byte| **byte < 128).count(), missing_letters(&print.missing()))
    };
    assert_eq!(dark(" "), (0, None), "the control");
    // What labels of this program have, and names of places.
    for text in ["τ_relax", "µm⁴", "10⁻⁶ length⁻⁴", "t ∝ aᵖ", "χ²", "αβγδθκλωΣΔ", "ßéčşŁ", "Жук", "− ± × · … ≤ ≥ √ ∞ ∂"]
    {
        let (count, missing) = dark(text);
        assert!(count > 100, "{text}: {count}");
        assert_eq!(missing, None, "{text}");
    }
    let (_, missing) = dark("長 a 平");
    assert_eq!(missing.unwrap(), "2 letters not in the font of png and pdf, drawn as empty boxes: 平長");
}

#[test]
fn text_is_as_wide_as_charts_are_laid_out_for() {
    for text in ["median t_relax 0.412 (95 %: 0.401 to 0.420)", "ABCDEFGHIJKLM nopqrstuvwxyz 0123456789"] {
        let print = written(text, PaperWidth::default());
        let drawn = f64::from(print.tree.root().layer_bounding_box().width());
        let laid_out = width(text, SIZE);
        assert!((drawn / laid_out - 1.0).abs() < 0.02, "{text}: {drawn} {laid_out}");
    }
}

#[test]
fn a_pdf_has_the_size_of_the_width_and_the_letters_of_its_text() {
    let pdf = written("τ a", PaperWidth::default()).file(PaperFormat::Pdf).unwrap();
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.starts_with("%PDF-1.") && text.contains("/MediaBox"), "{text}");
    let sides = text.split("/MediaBox").nth(1).unwrap().split(['[', ']']).nth(1).unwrap();
    let sides: Vec<f64> = sides.split_whitespace().map(|side| side.parse().unwrap()).collect();
    assert!((sides[2] - 85.0 / 25.4 * 72.0).abs() < 0.01, "{sides:?}");
    assert!(text.contains("DejaVuSans") && text.contains("/ToUnicode"), "text is not text: {text}");
    let none = written("", PaperWidth::default()).file(PaperFormat::Pdf).unwrap();
    assert!(!String::from_utf8_lossy(&none).contains("/ToUnicode"), "the control");
}

#[test]
fn a_png_has_fills_strokes_dots_and_turned_text_where_they_are() {
    let style = ".a { fill: #00ff00; stroke: #ff0000; stroke-width: 4 } text { font-size: 12px; fill: #0000ff }
        .b { fill: none; stroke: #0000ff; stroke-width: 9; stroke-linecap: round; stroke-opacity: 0.6 }";
    let mut svg = Svg::new(100.0, 100.0, style, "a");
    svg.rectangle("a", [20.0, 20.0].into(), [30.0, 30.0].into(), 0.0);
    svg.path("b", "M80 30h0");
    svg.text_upwards("", [90.0, 95.0].into(), "xxxxxx");
    let print = Printer::default().read("Words", &svg.finish(), "100".parse().unwrap()).unwrap();
    let png = print.file(PaperFormat::png(254).unwrap()).unwrap();
    let pixels = pixels(&png);
    assert_eq!([number(&png, 16), number(&png, 20)], [1000, 1000]);
    let at = |x: usize, y: usize| <[u8; 3]>::try_from(&pixels[3 * (10_000 * y + 10 * x)..][..3]).unwrap();
    let [white, red, green, dot] = [[255; 3], [255, 0, 0], [0, 255, 0], [102, 102, 255]];
    for (x, y, colour) in [
        (35, 35, green),
        (35, 21, red),
        (35, 19, red),
        (21, 35, red),
        (35, 17, white),
        (53, 35, white),
        (80, 30, dot),
        (83, 31, dot),
        (86, 30, white),
    ] {
        assert_eq!(at(x, y), colour, "{x} {y}");
    }
    let blue = |from: [usize; 2], to: [usize; 2]| {
        let rows =
            (10 * from[1]..10 * to[1]).map(|y| &pixels[3 * (1000 * y + 10 * from[0])..3 * (1000 * y + 10 * to[0])]);
        rows.flat_map(|row| row.chunks(3)).filter(|pixel| **pixel == [0, 0, 255]).count()
    };
    // Upwards from its place, and nowhere else.
    assert!(blue([81, 50], [92, 95]) > 2000 && blue([0, 50], [81, 100]) == 0, "the text is elsewhere");
}

#[test]
fn a_pdf_has_every_dot_dash_colour_and_opacity() {
    let style = ".a { fill: none; stroke: #ff0000; stroke-width: 5; stroke-linecap: round; stroke-opacity: 0.5 }
        .b { fill: none; stroke: #808080; stroke-linejoin: round; stroke-dasharray: 6 4 }
        .c { fill: #0000ff; stroke: #000000; fill-rule: evenodd } .d { fill: #000000 }";
    let mut svg = Svg::new(200.0, 100.0, style, "a");
    svg.path("a", "M10 20h0M30 20h0");
    svg.path("b", "M1 2L3 4Q5 6 7 8");
    svg.path("c", "M11 12L13 14L15 12Z");
    svg.rectangle("d", [50.0, 60.0].into(), [7.0, 9.0].into(), 0.0);
    let print = Printer::default().read("Words", &svg.finish(), "100".parse().unwrap()).unwrap();
    let pdf = print.file(PaperFormat::Pdf).unwrap();
    let page = &streams(&pdf)[0];
    // Upside down, and of 100 mm.
    assert!(page.starts_with("1.41732") && page.contains("-1.41732") && page.contains(" 141.732"), "{page}");
    for said in [
        "1 0 0 RG\n5 w\n1 J",
        "10 20 m\n10 20 l\n30 20 m\n30 20 l\nS",
        " G\n1 w\n0 J\n1 j",
        "[6 4] 0 d\n",
        "1 2 m\n3 4 l\n4.333",
        " 7 8 c\nS",
        "0 0 1 rg\n11 12 m\n13 14 l\n15 12 l\nh\nf*",
        "0 G\n1 w",
        "50 60 m\n57 60 l\n57 69 l\n50 69 l\nh\nf",
    ] {
        assert!(page.contains(said), "{said:?} is not in {page}");
    }
    assert_eq!(page.matches("/O0 gs").count(), 1, "{page}");
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.contains("/CA 0.5") && text.contains("/ca 0.5"), "{text}");
}

#[test]
fn lines_of_text_are_whole_and_turned_as_in_the_picture() {
    let mut svg =
        Svg::new(200.0, 100.0, "text { font-family: sans-serif; font-size: 12px } .wide { letter-spacing: 3px }", "a");
    svg.text("wide", [20.0, 40.0].into(), "AVA τ");
    svg.text_upwards("", [10.0, 90.0].into(), "AVA");
    let print = Printer::default().read("Words", &svg.finish(), "page".parse().unwrap()).unwrap();
    let streams = streams(&print.file(PaperFormat::Pdf).unwrap());
    let page = &streams[0];
    assert_eq!((page.matches("TJ").count(), page.matches("/F 12 Tf").count()), (2, 2), "{page}");
    assert!(page.contains("1 0 0 -1 20 40 Tm") && page.contains(" -1 1 ") && page.contains(" -80 100 cm"), "{page}");
    // 3 of 12 pixels, to the left.
    assert_eq!(page.matches(" -250 ").count(), 4, "{page}");
    assert!(page.contains(r"[(\000\001\000\002\000\001)] TJ"), "{page}");
    let texts = streams.iter().find(|text| text.contains("beginbfchar")).unwrap();
    for letter in ["<0001> <0041>", "<0002> <0056>", "<0004> <03C4>"] {
        assert!(texts.contains(letter), "{texts}");
    }
}

#[test]
fn what_no_picture_of_this_program_has_is_refused() {
    let clip = "<clipPath id='c'><rect width='5' height='5'/></clipPath>";
    let gradient = "<linearGradient id='g'><stop offset='0'/><stop offset='1' stop-color='red'/></linearGradient>";
    for (content, unknown) in [
        ("<g opacity='0.5'><rect width='9' height='9'/></g>".to_string(), "a group with an opacity"),
        (format!("{clip}<rect clip-path='url(#c)' width='9' height='9'/>"), "a group that is clipped"),
        (format!("{gradient}<rect fill='url(#g)' width='9' height='9'/>"), "a paint that is no colour"),
        (format!("{gradient}<text y='9' fill='url(#g)'>a</text>"), "a paint that is no colour"),
        ("<text y='9' stroke='red'>a</text>".into(), "text with outlines"),
        ("<text y='9' text-decoration='underline'>a</text>".into(), "text with lines"),
        ("<rect fill='red' width='9' height='9'/><text y='9'>a</text>".into(), ""),
    ] {
        let svg = format!("<svg xmlns='http://www.w3.org/2000/svg' width='20' height='20'>{content}</svg>");
        let error = Printer::default().read("Words", &svg, PaperWidth::default()).err().map(|e| e.to_string());
        assert_eq!(error.is_some(), !unknown.is_empty(), "{content}: {error:?}");
        assert!(error.is_none_or(|error| error.contains(unknown)), "{content}: {unknown}");
    }
}

#[test]
fn every_chart_is_printed_to_equal_bytes() {
    let (column, printer) = (PaperWidth::default(), Printer::default());
    let format = PaperFormat::png(100).unwrap();
    for (name, svg) in draw_all(Medium::Paper(column.pixels())) {
        let print = |format| printer.read(&name, &svg, column).unwrap().file(format).unwrap();
        let png = print(format);
        assert!(pixels(&png).chunks(3).any(|pixel| pixel != [255; 3]), "{name} is blank");
        assert!(png == print(format), "{name}");
        assert!(print(PaperFormat::Pdf) == print(PaperFormat::Pdf), "{name}");
        // To look at: CURVELAX_CHARTS=FOLDER cargo test -p curvelax-paper
        if let Some(folder) = std::env::var_os("CURVELAX_CHARTS") {
            let at = |extension: &str| std::path::Path::new(&folder).join(format!("{name}.{extension}"));
            std::fs::write(at("png"), print(PaperFormat::png(300).unwrap())).unwrap();
            std::fs::write(at("pdf"), print(PaperFormat::Pdf)).unwrap();
        }
    }
}

#[test]
fn wrong_densities_and_pictures_that_are_too_large_are_refused() {
    for dpi in [71, 1201, -3] {
        let error = PaperFormat::png(dpi).unwrap_err();
        assert_eq!(error.to_string(), format!("--dpi {dpi}: out of range; use 72 to 1200 dots per inch"));
    }
    let svg = Svg::new(100.0, 5000.0, "", "a").finish();
    let print = Printer::default().read("Members", &svg, "page".parse().unwrap()).unwrap();
    assert!(print.file(PaperFormat::png(100).unwrap()).is_ok());
    let error = print.file(PaperFormat::png(1200).unwrap()).unwrap_err();
    let said = "--dpi 1200: Members would have 8031 × 401575 pixels, 10⁸ are the most; use fewer dots per inch";
    assert!(error.to_string().starts_with(said) && error.exit_code() == 2, "{error}");
    assert!(Printer::default().read("Words", "<svg", PaperWidth::default()).is_err());
}

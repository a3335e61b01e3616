//! Pictures of every kind of data, to test and to look at. Tests of crates above have this file as a module, too.
#![allow(dead_code)] // every test uses a different part of it

use std::sync::OnceLock;

use curvelax_base::interval::Interval;
use curvelax_draw::{charts::*, medium::Medium};

/// Numbers in (0, 1), equal on every machine: Halton numbers of base 2 or 3.
fn spread(i: usize, base: usize) -> f64 {
    let (mut share, mut value, mut i) = (1.0, 0.0, i + 1);
    while i > 0 {
        share /= base as f64;
        value += share * (i % base) as f64;
        i /= base;
    }
    value
}

/// Roughly normal, with mean 0 and variance 1: quantiles of the logistic distribution, scaled.
fn normal(i: usize) -> f64 {
    let u = spread(i, 2);
    (u / (1.0 - u)).ln() / 1.814
}

fn times(count: usize, median: f64, width: f64) -> Vec<f64> {
    (0..count).map(|i| median * (width * normal(i)).exp()).collect()
}

/// A Kaplan-Meier curve of members censored at `end`; some are censored earlier.
pub fn survival(count: usize, median: f64, end: f64) -> SurvivalCurve {
    let mut all: Vec<(f64, bool)> =
        times(count, median, 0.5).into_iter().enumerate().map(|(i, t)| (t.min(end), t < end && i % 17 != 3)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut curve = SurvivalCurve::default();
    let (mut share, mut low, mut high) = (1.0, vec![], vec![]);
    for (i, (t, relaxed)) in all.iter().enumerate() {
        if *relaxed {
            share *= 1.0 - 1.0 / (count - i) as f64;
            curve.t.push(*t);
            curve.survival.push(share);
            let error = 1.96 * (share * (1.0 - share) / count as f64).sqrt();
            low.push((share - error).max(0.0));
            high.push((share + error).min(1.0));
        } else {
            curve.censored.push(*t);
        }
    }
    curve.band = Some((low, high));
    curve
}

/// The mean excess of a cell that decays at this rate after a faster start, at `count` times up to 1.5.
pub fn decay(rate: f64, count: usize) -> DecayCurve {
    let t: Vec<f64> = (0..count).map(|i| 1.5 * i as f64 / (count - 1) as f64).collect();
    let mean: Vec<f64> = t.iter().map(|t| 0.07 * (-rate * t).exp() + 0.03 * (-9.0 * rate * t).exp()).collect();
    let band = (mean.iter().map(|e| 0.6 * e).collect(), mean.iter().map(|e| 1.5 * e).collect());
    DecayCurve { t, mean, band: Some(band) }
}

fn level(at: Setting, median: f64) -> DependencePoint {
    let median = EstimatedNumber { value: median, interval: Some(Interval::between(0.95 * median, 1.06 * median)) };
    DependencePoint { at, median: Some(median), quartiles: (Some(0.8 * median.value), Some(1.3 * median.value)) }
}

/// Medians scattered about factor·amplitude^(−0.31), at `count` amplitudes from 0.01.
pub fn amplitudes(factor: f64, count: usize) -> Series {
    let amplitude = |i: usize| 0.01 * 1.6_f64.powi(i as i32);
    let law = |x: f64| factor * x.powf(-0.31);
    let levels = (0..count).map(|i| level(Setting::Number(amplitude(i)), law(amplitude(i)) * (1.0 + 0.05 * normal(i))));
    let exponent = EstimatedNumber { value: -0.312, interval: Some(Interval::between(-0.33, -0.294)) };
    let fit = Some(PowerLawLine { exponent, factor, rejected: false });
    Series { levels: levels.collect(), fit }
}

const NOTE: &str = "ellipse:2,1, surface-diffusion, n = 100, adaptive 0.0001, t-end = 2, seed 1";

/// A title above the note, with the key.
fn text(title: &str, quantity: &str, key: CellKey) -> ChartText {
    ChartText { title: title.into(), note: NOTE.into(), quantity: quantity.into(), key }
}

/// Cells that differ in the amplitude, with the label and the value of each.
fn key(cells: impl Iterator<Item = (String, f64)>) -> CellKey {
    let (labels, values): (Vec<String>, Vec<f64>) =
        cells.map(|(shown, value)| (format!("amplitude = {shown}"), value)).unzip();
    CellKey { names: labels.clone(), labels, values: Some(values), .."amplitude".into() }
}

/// Every chart with data of every kind, and its name; drawn once.
pub fn pictures() -> &'static [(String, String)] {
    static PICTURES: OnceLock<Vec<(String, String)>> = OnceLock::new();
    PICTURES.get_or_init(|| draw_all(Medium::Screen))
}

/// See [`pictures`].
pub fn draw_all(medium: Medium) -> Vec<(String, String)> {
    let mut pictures = Vec::new();
    let mut add = |name: &str, svg: String| pictures.push((name.to_owned(), svg));
    let unknown = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE];
    let some = [("unfinished", 88), ("stalled", 12), ("singular", 0)];

    let relaxation = |times: &[f64], others: &[(&str, u64)], median: Option<f64>| {
        let median = median
            .map(|value| EstimatedNumber { value, interval: Some(Interval::between(0.97 * value, 1.04 * value)) });
        let members = times.len() as u64 + others.iter().map(|(_, count)| count).sum::<u64>();
        let cells = vec![CellValues { numbers: times.to_vec(), members }];
        let text = text("Relaxation times", "t_relax", CellKey::default());
        RelaxationTimes { text, cells, others, median }.draw(medium)
    };
    add("relaxation", relaxation(&times(412, 0.4, 0.2), &some, Some(0.42)));
    add("relaxation-wide", relaxation(&times(5000, 1e-6, 1.5), &[], Some(1e-6)));
    add("relaxation-none", relaxation(&[], &some, None));
    add("relaxation-empty", relaxation(&[], &[], None));
    add("relaxation-one", relaxation(&[0.4], &[], Some(0.4)));
    add("relaxation-zero", relaxation(&[0.0, 0.0], &[], Some(0.0)));
    add("relaxation-equal", relaxation(&[0.4; 100], &[("unfinished", 1)], Some(0.4)));
    add("relaxation-unknown", relaxation(&unknown, &[], Some(f64::NAN)));
    add("relaxation-million", relaxation(&times(1_000_000, 0.4, 0.3), &some, Some(0.4)));

    let rates = |rates: &[f64], relative: bool, without: u64| {
        let cells = vec![CellValues { numbers: rates.to_vec(), members: rates.len() as u64 }];
        let (text, unit) = (text("Rates of decay", "", CellKey::default()), "length⁻⁴");
        FittedRates { text, cells, relative, unit, without }.draw(medium)
    };
    add("rates", rates(&times(412, 1.0, 0.01), true, 3));
    add("rates-absolute", rates(&times(412, 24.0, 0.5), false, 0));
    add("rates-negative", rates(&[-0.1, 0.4, 1.0], true, 0));
    add("rates-none", rates(&[], true, 256));
    add("rates-one", rates(&[1.0], true, 0));
    add("rates-unknown", rates(&unknown, true, 0));
    add("rates-million", rates(&times(1_000_000, 1.0, 0.3), true, 1));

    let by_cell = |count: usize, members: usize| -> Vec<CellValues> {
        let cell =
            |i: usize| CellValues { numbers: times(members, 1.0 + 0.1 * i as f64, 0.1), members: members as u64 + 7 };
        (0..count).map(cell).collect()
    };
    for (count, members) in [(2, 512), (8, 256), (20, 100), (300, 1000)] {
        let (cells, without) = (by_cell(count, members), 7 * count as u64);
        let text = |title: &str| text(title, "t_relax", key((0..count).map(|i| (i.to_string(), i as f64))));
        let others = &[("unfinished", without)];
        let times = text("Relaxation times");
        let times = RelaxationTimes { text: times, cells: cells.clone(), others, median: None };
        add(&format!("relaxation-cells-{count}"), times.draw(medium));
        let rates = text("Rates of decay");
        let rates = FittedRates { text: rates, cells, relative: true, unit: "length⁻⁴", without };
        add(&format!("rates-cells-{count}"), rates.draw(medium));
    }

    let amplitude = |i: usize| 0.01 * 1.3_f64.powi(i as i32);
    let growing =
        |cells: usize| key((0..40).cycle().take(cells).map(|i| (format!("{:.3}", amplitude(i)), amplitude(i))));
    let share = |key: CellKey| text("Share that has not relaxed", "t", key);
    let survive = |curves: Vec<SurvivalCurve>| {
        let text = share(growing(curves.len()));
        Survival { text, curves, ..Survival::default() }.draw(medium)
    };
    let cells = |cells: usize, count: usize| -> Vec<SurvivalCurve> {
        (0..cells).map(|i| survival(count, 0.3 + 0.1 * i as f64, 1.4)).collect()
    };
    add("survival-1", survive(cells(1, 256)));
    add("survival-3", survive(cells(3, 512)));
    add("survival-8", survive(cells(8, 512)));
    add("survival-20", survive(cells(20, 200)));
    add("survival-1000", survive(cells(40, 2000).into_iter().cycle().take(1000).collect()));
    add("survival-million", survive(cells(4, 250_000)));
    add("survival-wide", survive((0..3).map(|i| survival(200, 0.01 * 20_f64.powi(i), 100.0)).collect()));
    add("survival-none", survive(vec![]));
    add("survival-empty", survive(vec![SurvivalCurve::default(); 12]));
    let alone = SurvivalCurve { t: vec![0.4], survival: vec![0.0], ..SurvivalCurve::default() };
    add("survival-one", survive(vec![alone.clone()]));
    add("survival-censored", survive(vec![SurvivalCurve { t: vec![], censored: vec![2.0; 9], ..alone.clone() }]));
    let (t, survival) = (unknown.to_vec(), unknown.to_vec());
    add("survival-unknown", survive(vec![SurvivalCurve { t, survival, ..alone }]));

    let theory =
        Theory { label: "exp(−24 t/R⁴), R = 1.41".into(), law: DecayLaw::Exponential { start: 0.06, rate: 6.0 } };
    let algebraic = DecayLaw::Algebraic { start: 0.09, time: 0.5, power: 4.0 };
    let algebraic = Theory { label: "(1 + 2t/R₀⁴)⁻⁴".into(), law: algebraic };
    let fall_by = |theory: &Theory, curves: Vec<DecayCurve>| {
        let (text, theory) = (text("Mean excess in time", "", growing(curves.len())), vec![theory.clone()]);
        Decay { text, band: "5 to 95 % of the members", curves, theory }.draw(medium)
    };
    let fall = |curves: Vec<DecayCurve>| fall_by(&theory, curves);
    let falls =
        |cells: usize, count: usize| -> Vec<DecayCurve> { (0..cells).map(|i| decay(6.0 + i as f64, count)).collect() };
    add("decay-1", fall(falls(1, 60)));
    add("decay-3", fall(falls(3, 200)));
    add("decay-30", fall(falls(30, 5000)));
    add("decay-long", fall(vec![decay(60.0, 500)]));
    add("decay-algebraic", fall_by(&algebraic, falls(2, 400)));
    add("decay-million", fall(falls(4, 250_000)));
    add("decay-none", fall(vec![]));
    add("decay-one", fall(vec![DecayCurve { t: vec![0.0], mean: vec![0.1], ..DecayCurve::default() }]));
    let zero = DecayCurve { t: vec![0.0, 1.0], mean: vec![0.0; 2], ..DecayCurve::default() };
    add("decay-zero", fall(vec![zero.clone()]));
    add("decay-equal", fall(vec![DecayCurve { mean: vec![0.1; 2], ..zero }]));
    let unknowns = unknown.to_vec();
    let band = Some((unknowns.clone(), unknowns.clone()));
    add("decay-unknown", fall(vec![DecayCurve { t: unknowns.clone(), mean: unknowns, band }]));

    let depend_on = |labels: Vec<String>, values: Option<Vec<f64>>, series: Vec<Series>, key: &str| {
        let other = CellKey { labels, values, ..CellKey::from("aspect") };
        let text = text("Relaxation time against amplitude", "t_relax", other);
        Dependence { text, key, series }.draw(medium)
    };
    let depend = |series: Vec<Series>, key: &str| depend_on(vec!["all".into()], None, series, key);
    add("dependence", depend(vec![amplitudes(0.12, 8)], "amplitude"));
    let mut partial = amplitudes(0.12, 8);
    partial.fit = None;
    partial.levels[0].median = None;
    partial.levels[0].quartiles.1 = None;
    partial.levels[1].quartiles.1 = None;
    let unsaid = ChartText { note: String::new(), ..text("Linear axes", "t_relax", CellKey::default()) };
    let linear = Dependence { text: unsaid, key: "amplitude", series: vec![partial] };
    add("dependence-partial", linear.draw(medium));
    for count in [3, 8, 12] {
        let labels = (1..=count).map(|aspect| format!("aspect = {aspect}")).collect();
        let factors: Vec<f64> = (0..count).map(|i| 0.1 * 1.3_f64.powi(i)).collect();
        let series = factors.iter().map(|factor| amplitudes(*factor, 6)).collect();
        add(&format!("dependence-{count}"), depend_on(labels, Some(factors), series, "amplitude"));
    }
    let named = |names: &[&str], factor: f64| -> Series {
        let levels = names.iter().enumerate();
        let levels = levels.map(|(i, name)| level(Setting::Name((*name).into()), factor * (1.0 + 0.4 * i as f64)));
        Series { levels: levels.collect(), fit: None }
    };
    let flows = ["surface-diffusion", "willmore", "elastic:0.5", "poly:0.1,0.25,0.333333333,0.1,0.0001,12345"];
    add("dependence-named", depend(vec![named(&flows, 0.3)], "flow"));
    let factors = [0.1, 0.2, 0.4];
    let (labels, series) = (factors.map(|factor| format!("λ = {factor}")), factors.map(|factor| named(&flows, factor)));
    add("dependence-named-3", depend_on(labels.into(), None, series.into(), "flow"));
    let names: Vec<String> = (0..60).map(|i| format!("file:island-{i}.csv")).collect();
    add("dependence-names", depend(vec![named(&names.iter().map(String::as_str).collect::<Vec<_>>(), 0.3)], "shape"));
    add("dependence-none", depend(vec![], "amplitude"));
    add("dependence-one", depend(vec![amplitudes(0.12, 1)], "amplitude"));
    let level = DependencePoint { at: Setting::Number(f64::NAN), median: None, quartiles: (None, None) };
    add("dependence-unreached", depend(vec![Series { levels: vec![level.clone(); 3], fit: None }], "amplitude"));
    let median = Some(EstimatedNumber { value: 0.4, interval: Some(Interval::between(f64::NAN, f64::INFINITY)) });
    let (at, fit) = (
        Setting::Number(0.0),
        Some(PowerLawLine {
            exponent: EstimatedNumber { value: f64::NAN, interval: None },
            factor: 0.0,
            rejected: true,
        }),
    );
    let levels = vec![DependencePoint { at, median, quartiles: (Some(f64::NAN), None) }, level];
    add("dependence-unknown", depend(vec![Series { levels, fit }], "amplitude"));

    let mesh = |mesh_ratio: &[f64], metric_drift: &[f64]| {
        let [mesh_ratio, metric_drift] =
            [mesh_ratio, metric_drift].map(|values| values.iter().map(|v| *v as f32).collect::<Vec<_>>());
        let [mesh_ratio, metric_drift] = [&mesh_ratio[..], &metric_drift[..]];
        let distrusted = (0.1, metric_drift.iter().filter(|drift| **drift > 0.1).count());
        let text = text("Mesh quality at the end", "", CellKey::default());
        MeshQuality { text, mesh_ratio, metric_drift, distrusted }.draw(medium)
    };
    let ratios = |count: usize| -> Vec<f64> { times(count, 0.05, 0.4).iter().map(|t| 1.0 + t).collect() };
    add("mesh", mesh(&ratios(512), &times(512, 1e-3, 2.2)));
    add("mesh-million", mesh(&ratios(1_000_000), &times(1_000_000, 1e-3, 0.5)));
    add("mesh-none", mesh(&[], &[]));
    add("mesh-one", mesh(&[1.0], &[0.0]));
    add("mesh-zero", mesh(&[1.0, 1.1], &[0.0, 1e-4, 1e-2]));
    add("mesh-equal", mesh(&[1.0; 100], &[1e-3; 100]));
    add("mesh-unknown", mesh(&unknown, &unknown));

    let tenths = |cells: usize| key((0..cells).map(|i| (format!("0.{i}"), 0.1 * i as f64)));
    let scatter = |count: usize, cells: usize, panels: usize| {
        let point = |i: usize, panel: usize| {
            let x = 0.05 * normal(i);
            let t = 0.8 + x + 0.03 * panel as f64 * (spread(i, 3) - 0.5);
            ScatterPoint { cell: i % cells, member: i as u64, x, t, happened: i % 17 != 3 }
        };
        let panel = |panel: usize| ScatterPanel {
            feature: ["cos_2", "descriptor_2", "excess_start", "k_min_start"][panel].into(),
            heading: "R² 0.923, Spearman −0.930".into(),
            points: (0..count).map(|i| point(i, panel)).collect(),
        };
        let text = text("What explains the relaxation time", "t_relax", tenths(cells));
        let panels = (0..panels).map(panel).collect();
        Scatter { text, notes: Vec::new(), cells, panels, reason: "Nothing is claimed." }
    };
    add("scatter", scatter(256, 1, 4).draw(medium));
    add("scatter-cells-3", scatter(250, 3, 4).draw(medium));
    add("scatter-cells-12", scatter(250, 12, 3).draw(medium));
    add("scatter-one", scatter(1, 1, 1).draw(medium));
    add("scatter-none", scatter(0, 1, 0).draw(medium));
    let mut unknown_dots = scatter(30, 1, 2);
    unknown_dots.panels[1].points[4].x = f64::INFINITY;
    unknown_dots.panels[0].points[5].t = f64::NAN;
    add("scatter-unknown", unknown_dots.draw(medium));

    let quantiles = |count: usize, known: f64| {
        let cell = |i: usize| {
            let at = |z: f64| 0.8 * (0.1 * i as f64 + (0.1 + 0.02 * i as f64) * z).exp();
            let place = |(share, z): (f64, f64)| (share <= known).then(|| at(z));
            CellQuantiles {
                places: [(0.05, -1.645), (0.25, -0.674), (0.5, 0.0), (0.75, 0.674), (0.95, 1.645)].map(place),
                quantiles: (1..50).map(|j| f64::from(j) * 0.1 - 2.5).map(|z| (z, at(z))).collect(),
            }
        };
        let text = text("Distribution of the relaxation times", "t_relax", tenths(count));
        TimeDistribution { text, keys: "amplitude", cells: (0..count).map(cell).collect() }
    };
    add("distribution", quantiles(1, 1.0).draw(medium));
    add("distribution-cells-5", quantiles(5, 1.0).draw(medium));
    add("distribution-cells-30", quantiles(30, 1.0).draw(medium));
    add("distribution-censored", quantiles(2, 0.6).draw(medium));
    add("distribution-none", quantiles(2, 0.0).draw(medium));
    let mut unknown_place = quantiles(2, 1.0);
    unknown_place.cells[1].places = [Some(f64::INFINITY), Some(-1.0), Some(0.0), Some(f64::NAN), None];
    add("distribution-unknown", unknown_place.draw(medium));

    let crossed = || {
        let [colours, patterns] = [["0.01", "0.1", "0.2"].as_slice(), ["surface-diffusion", "willmore"].as_slice()]
            .map(|labels| labels.iter().map(|label| (*label).to_owned()).collect());
        Crossed { colours, patterns, places: (0..6).map(|i| (i / 2, i % 2)).collect() }
    };
    for (name, named_elsewhere) in [("crossed", false), ("crossed-told", true)] {
        let key = |own: CellKey| CellKey { crossed: Some(crossed()), named_elsewhere, ..own };
        let mut boxes = quantiles(6, 1.0);
        boxes.text.key = key(tenths(6));
        add(&format!("distribution-{name}"), boxes.draw(medium));
        let mut dots = scatter(250, 6, 2);
        dots.text.key = key(tenths(6));
        add(&format!("scatter-{name}"), dots.draw(medium));
        let (text, curves) = (share(key(growing(6))), cells(6, 100));
        add(&format!("survival-{name}"), Survival { text, curves, ..Survival::default() }.draw(medium));
    }
    let wide = Crossed { colours: (0..12).map(|i| i.to_string()).collect(), ..crossed() };
    let wide = Crossed { places: (0..24).map(|i| (i / 2, i % 2)).collect(), ..wide };
    let (text, curves) = (share(CellKey { crossed: Some(wide), ..growing(24) }), cells(24, 100));
    add("survival-crossed-24", Survival { text, curves, ..Survival::default() }.draw(medium));

    let few = |members: Vec<MemberDot>| {
        let text = self::text("Relaxation times", "t_limit", CellKey::default());
        MemberTimes { text, members }.draw(medium)
    };
    let dot =
        |name: &str, t: f64, error: Option<f64>, happened: bool| MemberDot { name: name.into(), t, error, happened };
    add(
        "members",
        few(vec![
            dot("iceland", 0.158, Some(3e-4), true),
            dot("jamaica", 0.12, Some(0.01), true),
            dot("a name that is long enough to be cut off somewhere near its end, madagascar", 0.2, None, true),
            dot("sri-lanka", 0.3, None, false),
        ]),
    );
    add("members-one", few(vec![dot("all", 0.4, Some(1e-3), true)]));
    add("members-zero", few(vec![dot("all", 0.0, None, true), dot("other", 0.0, Some(0.0), true)]));
    add("members-wide", few((0..20).map(|i| dot(&i.to_string(), 10_f64.powi(i - 9), Some(0.5), i % 3 > 0)).collect()));
    add("members-unknown", few(unknown.iter().map(|t| dot("one", *t, Some(*t), true)).collect()));
    add("members-none", few(vec![]));

    let work = |rows: Vec<WorkPanels>| {
        let text = self::text("What an error of the relaxation time costs", "", CellKey::default());
        WorkDiagram { text, costs: [("solves per member", ""), ("time per member", "ms")], rows }.draw(medium)
    };
    let way = |order: i32| {
        let point = |i: i32| (10_f64.powi(-i * order), [10.0 * 4_f64.powi(i), 0.1 * 4_f64.powi(i)]);
        WorkCurve { label: format!("order up to {order}"), points: (1..5).map(point).collect() }
    };
    let panels = |label: &str| WorkPanels { label: label.into(), curves: (1..7).map(way).collect() };
    add("work", work(vec![panels("direct"), panels("gauss-seidel")]));
    add("work-none", work(vec![]));
    let unknown_cost = WorkCurve { label: "one".into(), points: vec![(0.0, [1.0, 2.0]), (1e-3, [f64::NAN, 2.0])] };
    add("work-unknown", work(vec![WorkPanels { label: "direct".into(), curves: vec![unknown_cost] }]));

    let hostile =
        "<script>alert(\"a & b\")</script> and a title that is so long that it has to be broken into lines \0";
    let key = CellKey { labels: vec![hostile.into(); 2], ..hostile.into() };
    let text = ChartText { note: hostile.into(), ..self::text(hostile, hostile, key) };
    let curves = vec![cells(1, 20).remove(0); 2];
    add("hostile", Survival { text, share: hostile, none: hostile, curves }.draw(medium));
    pictures
}

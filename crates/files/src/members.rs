//! `members.csv`: the features of each member. Its columns follow from the spec; a member has empty fields for the
//! features that only members of other cells have.

use super::{
    column::{Field, known},
    fields::Fields,
    part_file::{Mark, PartFile},
    place::Place,
    table_reader::LineReader,
    tables::Table,
};
use curvelax_base::error::Result;
use curvelax_ensemble::{Feature, Features, Outcome, Spec};

/// The first columns, with their meanings.
pub const OWN: [(&str, &str, &str); 3] = [
    ("member", "integer", "index of the member, from 0"),
    ("cell", "integer", "index of its cell, from 0"),
    ("label", "word", "name of its outline; empty if it has none"),
];

/// The table, which grows row by row.
pub struct MemberTable {
    table: Table<Features>,
    spec: Spec,
    features: Vec<Feature>,
    /// The last cell, and the column of each of its features; some have none.
    places: Option<(u64, Vec<Option<usize>>)>,
}

impl MemberTable {
    /// Begins the table of a run of `spec` with its header, or continues after the rows in `file`.
    pub fn new(file: PartFile, spec: &Spec) -> Result<MemberTable> {
        let features = spec.all_features()?;
        let table = Table::with_header(file, header(&features))?;
        // Lists are not needed for features.
        let spec = Spec { only: None, snapshots: Vec::new(), ..spec.clone() };
        Ok(MemberTable { table, spec, features, places: None })
    }

    /// Writes the row of a member.
    pub fn row(&mut self, outcome: &Outcome, Features(numbers): &Features) -> Result<()> {
        let Outcome { member, cell, ref label, .. } = *outcome;
        let places = self.places(cell)?;
        let mut row = vec![f64::NAN; self.features.len()];
        for (place, number) in places.iter().zip(numbers) {
            place.iter().for_each(|place| row[*place] = *number);
        }
        self.places = Some((cell, places));
        let field = |(feature, value): (&Feature, f64)| match feature.is_flag && value.is_finite() {
            true => Field::Whole(u64::from(value > 0.0)),
            false => Field::Float(known(value)),
        };
        let own = [Field::Whole(member), Field::Whole(cell), Field::Word(label)];
        self.table.write(own.into_iter().chain(self.features.iter().zip(row).map(field)))
    }

    /// The column of each feature of a cell.
    fn places(&mut self, cell: u64) -> Result<Vec<Option<usize>>> {
        match self.places.take() {
            Some((of, places)) if of == cell || !self.spec.sweeps_features() => Ok(places),
            _ => {
                let own = self.spec.of_cell(cell)?.cell_features();
                let place = |feature: Feature| self.features.iter().position(|other| other.name == feature.name);
                Ok(own.into_iter().map(place).collect())
            }
        }
    }

    /// As [`Table::mark`].
    pub fn mark(&mut self) -> Result<Mark> {
        self.table.mark()
    }

    /// As [`Table::keep`].
    pub fn keep(&self, keep: bool) {
        self.table.keep(keep);
    }

    /// As [`Table::ready`].
    pub fn ready(self) -> Result<PartFile> {
        self.table.ready()
    }
}

/// The headings.
fn header(features: &[Feature]) -> impl Iterator<Item = &str> {
    OWN.into_iter().map(|(name, ..)| name).chain(features.iter().map(|feature| &*feature.name))
}

/// The table of a run, read row by row.
pub struct MemberReader {
    lines: LineReader,
    features: Vec<Feature>,
}

impl MemberReader {
    /// Opens the table at `place`, of a run of `spec`.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if it does not exist, has other columns, or is
    /// truncated.
    pub fn open(place: &Place, spec: &Spec) -> Result<MemberReader> {
        let features = spec.all_features()?;
        let names = header(&features).map(String::from).collect();
        Ok(MemberReader { lines: LineReader::open(place, names)?, features })
    }

    /// The features of its columns.
    pub fn features(&self) -> &[Feature] {
        &self.features
    }

    /// Returns the next member and its cell, and the fields of its features, which are numbers.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) for a field that is no index.
    pub fn read(&mut self) -> Result<Option<(u64, u64, Fields<'_>)>> {
        let Some(mut fields) = self.lines.fields()? else { return Ok(None) };
        let (member, cell) = (fields.whole()?, fields.whole()?);
        fields.word();
        Ok(Some((member, cell, fields)))
    }
}

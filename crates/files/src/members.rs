//! `members.csv`: the features of each member. Its columns follow from the spec; a member has empty fields for the
//! features that only members of other cells have.

use super::{
    column::{Field, known},
    columns::of_growing,
    fields::Fields,
    names::MEMBERS,
    place::Place,
    table_reader::LineReader,
};
use curvelax_base::error::Result;
use curvelax_ensemble::{Feature, Features, Outcome, Spec};

/// The fields of its rows.
pub struct MemberFields {
    spec: Spec,
    features: Vec<Feature>,
    /// The last cell, and the column of each of its features; some have none.
    places: Option<(u64, Vec<Option<usize>>)>,
}

impl MemberFields {
    /// Those of a run of `spec`.
    pub fn new(spec: &Spec) -> Result<MemberFields> {
        let features = spec.all_features()?;
        // Lists are not needed for features.
        let spec = Spec { only: None, snapshots: Vec::new(), ..spec.clone() };
        Ok(MemberFields { spec, features, places: None })
    }

    /// The fields of a member.
    pub(super) fn of<'a>(
        &mut self,
        outcome: &'a Outcome,
        Features(numbers): &Features,
    ) -> Result<impl Iterator<Item = Field<'a>>> {
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
        let fields: Vec<Field<'_>> = self.features.iter().zip(row).map(field).collect();
        Ok(own.into_iter().chain(fields))
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
        let names = of_growing(MEMBERS, spec)?.into_iter().map(|[name, ..]| name).collect();
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

//! Values for the placeholders of a page.

use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fmt::Display;

/// Texts by the names of their placeholders.
#[derive(Clone, Debug, Default)]
pub struct Values(BTreeMap<String, String>);

impl<const N: usize> From<[(&str, String); N]> for Values {
    fn from(values: [(&str, String); N]) -> Self {
        Self(values.map(|(name, value)| (name.to_owned(), value)).into())
    }
}

impl Values {
    /// Adds a value.
    pub fn set(&mut self, name: impl Into<String>, value: impl Display) {
        self.0.insert(name.into(), value.to_string());
    }

    /// Adds the values of a study, prefixed with its name.
    pub fn add(&mut self, study: &str, values: &Self) {
        for (name, value) in &values.0 {
            self.set(format!("{study}.{name}"), value);
        }
    }

    /// Replaces each `{name}` in the template by its value.
    ///
    /// # Errors
    /// Fails if a placeholder has no value.
    pub fn fill(&self, template: &str) -> Result<String> {
        let mut text = String::new();
        let mut rest = template;
        while let Some((before, place)) = rest.split_once('{') {
            let (name, after) = place.split_once('}').context("a `{` without its `}`")?;
            let value = self
                .0
                .get(name)
                .with_context(|| format!("no value for {{{name}}}"))?;
            text += before;
            text += value;
            rest = after;
        }
        Ok(text + rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_its_value() {
        let mut values = Values::default();
        values.add(
            "study",
            &[("a", "1".to_owned()), ("b", "two".to_owned())].into(),
        );
        assert_eq!(values.fill("{study.b}, {study.a}.").unwrap(), "two, 1.");
        let error = values.fill("{c}").unwrap_err().to_string();
        assert_eq!(error, "no value for {c}");
        assert!(values.fill("{a").is_err());
    }
}

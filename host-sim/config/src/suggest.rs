//! "Did you mean …?"

/// The candidate closest to `word`, if it is close enough to be a likely
/// misspelling (a third of its length, at least two edits; a swap of neighbours is one).
#[must_use]
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase();
    candidates
        .into_iter()
        .map(|c| (distance(&word, &c.to_lowercase()), c))
        .filter(|(d, c)| *d <= (c.chars().count() / 3).max(2))
        .min_by_key(|(d, _)| *d)
        .map(|(_, c)| c)
}

/// Changes that make a candidate of a word; one where the word is its first part, as `fuzzy` of `fuzzy-pd`.
fn distance(word: &str, candidate: &str) -> usize {
    let rest = candidate.strip_prefix(word);
    match rest.filter(|rest| !word.is_empty() && rest.starts_with('-')) {
        Some(_) => 1,
        None => strsim::osa_distance(word, candidate),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_likely_word_and_nothing_far_fetched() {
        let words = ["three-step", "master-lost", "sinusoid"];
        assert_eq!(closest("three-stp", words), Some("three-step"));
        assert_eq!(closest("Three_step", words), Some("three-step"));
        assert_eq!(closest("sinusiod", words), Some("sinusoid"));
        assert_eq!(closest("walk", words), None);
        assert_eq!(closest("master", words), Some("master-lost"));
        assert_eq!(closest("", words), None);
        assert_eq!(closest("maste", words), None);
    }
}

//! Work on all threads, with results in the order of its items. Engines are compiled for each number of bins; rayon, which
//! hands out their work, is compiled once.

use std::ops::AddAssign;

use dtof_core::neighbours::Threads;
use rayon::prelude::*;

/// So many parts at most: a thread that is done takes another.
const PARTS: usize = 256;

/// Divides `items` into parts of at least `least` items. Calls `work` with the place of the first item and the items of
/// each part, and returns the results in this order.
pub fn of_parts<T: Send, R: Send>(
    items: &mut [T],
    least: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    let length = items.len().div_ceil(PARTS).max(least).max(1);
    let mut results: Vec<Option<R>> = Vec::new();
    results.resize_with(items.len().div_ceil(length), || None);
    let work = &work;
    let parts = items.chunks_mut(length).zip(&mut results).enumerate();
    let jobs = parts.map(|(number, (part, result))| -> Job<'_> {
        Box::new(move || *result = Some(work(number * length, part)))
    });
    run(jobs.collect());
    results.into_iter().flatten().collect()
}

/// Calls `work` for each number below `items`, in parts of at least `least`.
pub fn of_each<R: Send>(items: usize, least: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let mut results: Vec<Option<R>> = Vec::new();
    results.resize_with(items, || None);
    of_parts(&mut results, least, |first, part| {
        for (number, result) in (first..).zip(part) {
            *result = Some(work(number));
        }
    });
    results.into_iter().flatten().collect()
}

/// All threads of this computer, for an array of the core.
pub struct AllThreads;

impl AllThreads {
    /// Pixels that are worth a thread.
    const PIXELS: usize = 256;
}

impl Threads for AllThreads {
    fn each<P: Send, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        work: impl Fn(usize, &mut [P]) -> S + Sync,
    ) -> S {
        let mut sum = S::default();
        for part in of_parts(items, Self::PIXELS, work) {
            sum += part;
        }
        sum
    }

    fn decide<P: Send + Sync, D: Send + Sync, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        decide: impl Fn(&[P], usize) -> Option<D> + Sync,
        work: impl Fn(&mut P, Option<&D>, &mut S) + Sync,
    ) -> S {
        let found = of_each(items.len(), Self::PIXELS, |number| decide(items, number));
        self.each(items, |first, items| {
            let mut sum = S::default();
            for (item, found) in items.iter_mut().zip(&found[first..]) {
                work(item, found.as_ref(), &mut sum);
            }
            sum
        })
    }
}

type Job<'a> = Box<dyn FnOnce() + Send + 'a>;

fn run(jobs: Vec<Job<'_>>) {
    // One needs no other thread.
    if jobs.len() <= 1 {
        jobs.into_iter().for_each(|job| job());
    } else {
        jobs.into_par_iter().for_each(|job| job());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_is_worked_on_once_and_results_are_in_order() {
        for items in (0..700).chain([65_536]) {
            for least in [0, 1, 3, 256] {
                let mut counts = vec![0_u8; items];
                let parts = of_parts(&mut counts, least, |first, part| {
                    part.iter_mut().for_each(|count| *count += 1);
                    (first, part.len())
                });
                assert!(counts.iter().all(|&count| count == 1));
                assert!(parts.len() <= PARTS);
                let end = parts.iter().fold(0, |end, &(first, length)| {
                    assert_eq!(first, end);
                    end + length
                });
                assert_eq!(end, items);
                let whole = &parts[..parts.len().saturating_sub(1)];
                assert!(whole.iter().all(|&(_, length)| length >= least.max(1)));
            }
            assert_eq!(of_each(items, 1, |number| number), Vec::from_iter(0..items));
        }
    }
}

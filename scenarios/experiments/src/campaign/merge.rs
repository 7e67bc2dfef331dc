//! Merging of shards.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

use super::CampaignError;
use super::folder::{self, Folder};
use super::plan::Campaign;
use super::publish::{Published, publish};
use super::shard::Shard;

/// Merges the shards of a campaign, one in each of `parts`, into the folder `dir`.
///
/// The result has the same bytes as an undivided campaign with the scenario path of the first shard. The parts stay
/// unchanged.
///
/// # Errors
/// If a folder is not a complete shard, the shards belong to different campaigns, one is missing or given twice, or `dir`
/// belongs to another campaign; then no file is written. If the system refuses.
pub fn merge(parts: &[PathBuf], dir: &Path) -> Result<Published, CampaignError> {
    let shards = read_shards(parts)?;
    let Some((first, path)) = shards.values().next() else {
        let message = "no shards to merge".to_owned();
        return refuse(dir, message, "name the folders of all shards");
    };
    check_complete(first, path, &shards)?;
    let whole = first.with_shard(Shard::WHOLE);
    whole.check_folder(dir)?;
    let mut sources = Vec::with_capacity(shards.len());
    for (campaign, part) in shards.values() {
        match folder::published(part, campaign)? {
            Some(rows) => sources.push(rows),
            None => {
                let message = format!("shard {} is not complete", campaign.shard);
                return refuse(part, message, "run the shard again to resume it");
            }
        }
    }
    let (folder, whole) = Folder::open(dir, &whole)?;
    let published = publish(folder.dir(), &whole, &mut sources)?;
    folder.close()?;
    Ok(published)
}

impl Campaign {
    /// Refuses a folder that has shards of another campaign, before this one is run there. It may not exist.
    ///
    /// # Errors
    /// If a shard belongs to another campaign, or can't be read.
    pub fn check_shards(&self, folder: &Path) -> Result<(), BadInput> {
        let Ok(entries) = fs::read_dir(folder) else {
            return Ok(());
        };
        for entry in entries.flatten() {
            let path = entry.path();
            if let Some(existing) = Self::read_folder(&path)? {
                self.with_shard(existing.shard).check_folder(&path)?;
            }
        }
        Ok(())
    }

    fn with_shard(&self, shard: Shard) -> Self {
        Self {
            shard,
            ..self.clone()
        }
    }
}

/// Reads the campaign of each part, and refuses different campaigns and duplicate shards.
fn read_shards(parts: &[PathBuf]) -> Result<BTreeMap<Shard, (Campaign, &Path)>, CampaignError> {
    let mut shards: BTreeMap<Shard, (Campaign, &Path)> = BTreeMap::new();
    for part in parts {
        let campaign = shard(part)?;
        if let Some((first, path)) = shards.values().next()
            && let Some(difference) = difference(&campaign, first)
        {
            let message = format!(
                "belongs to another campaign than {} ({difference})",
                path.display()
            );
            let help = "give the folders of all shards of one campaign";
            return refuse(part, message, help);
        }
        if let Some((_, other)) = shards.insert(campaign.shard, (campaign.clone(), part)) {
            let message = format!("is shard {}, and so is {}", campaign.shard, other.display());
            return refuse(part, message, "give each shard once");
        }
    }
    Ok(shards)
}

/// First difference of two shards other than their index; `None` if both belong to one campaign.
fn difference(campaign: &Campaign, first: &Campaign) -> Option<String> {
    let of = first.shard.of();
    let division =
        (of != campaign.shard.of()).then(|| format!("shard: {}, not of {of}", campaign.shard));
    let same_shard = campaign.with_shard(first.shard);
    same_shard.difference(first).or(division)
}

/// Refuses shards of which some are missing.
fn check_complete(
    first: &Campaign,
    path: &Path,
    shards: &BTreeMap<Shard, (Campaign, &Path)>,
) -> Result<(), CampaignError> {
    let missing: Vec<_> = first
        .shard
        .all()
        .filter(|shard| !shards.contains_key(shard))
        .map(|shard| shard.to_string())
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    let message = format!(
        "is one of {} shards; missing: {}",
        first.shard.of(),
        missing.join(", ")
    );
    let help = "run the missing shards, and give their folders too";
    refuse(path, message, help)
}

/// Reads the campaign of one part.
fn shard(part: &Path) -> Result<Campaign, BadInput> {
    let Some(campaign) = Campaign::read_folder(part)? else {
        let help = "give folders written by `muster campaign --shard`";
        return Err(BadInput::without_excerpt(
            part,
            "contains no campaign",
            help,
        ));
    };
    campaign.check_program(part)?;
    Ok(campaign)
}

fn refuse<T>(path: &Path, message: String, help: &str) -> Result<T, CampaignError> {
    Err(BadInput::without_excerpt(path, message, help).into())
}

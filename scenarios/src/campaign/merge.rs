use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

use super::CampaignError;
use super::folder::{self, Folder};
use super::plan::Campaign;
use super::publish::{Published, publish};
use super::shard::Shard;

/// Puts the shards of a campaign, one in each of `parts`, together in the folder `dir`.
///
/// What comes of it are the same bytes as those of the campaign run undivided under the scenario's name of the first
/// shard. The parts are left as they are.
///
/// # Errors
/// When a folder is no shard at its end, the shards are not all of one campaign, one is missing or there twice, or
/// `dir` is another campaign's: of all that nothing is written. When the system refuses.
pub fn merge(parts: &[PathBuf], dir: &Path) -> Result<Published, CampaignError> {
    let mut shards: BTreeMap<Shard, (Campaign, &Path)> = BTreeMap::new();
    for part in parts {
        let campaign = shard(part)?;
        if let Some((first, path)) = shards.values().next() {
            let alike = Campaign {
                shard: first.shard,
                ..campaign.clone()
            };
            let same_division = first.shard.of() == campaign.shard.of();
            let difference = match alike.difference(first) {
                None if same_division => None,
                None => Some(format!(
                    "shard: {}, not of {}",
                    campaign.shard,
                    first.shard.of()
                )),
                difference => difference,
            };
            if let Some(difference) = difference {
                let message = format!(
                    "is of another campaign than {} ({difference})",
                    path.display()
                );
                return refuse(
                    part,
                    message,
                    "give the folders of all shards of one campaign",
                );
            }
        }
        if let Some((_, other)) = shards.insert(campaign.shard, (campaign.clone(), part)) {
            let message = format!("is shard {}, as {} is", campaign.shard, other.display());
            return refuse(part, message, "give each shard once");
        }
    }
    let Some((first, path)) = shards.values().next() else {
        return refuse(
            dir,
            "no shards to merge were named".to_owned(),
            "name their folders",
        );
    };
    let missing: Vec<_> = first
        .shard
        .all()
        .filter(|shard| !shards.contains_key(shard))
        .map(|shard| shard.to_string())
        .collect();
    if !missing.is_empty() {
        let message = format!(
            "is one of {} shards, and {} not there: {}",
            first.shard.of(),
            if missing.len() == 1 {
                "one is"
            } else {
                "some are"
            },
            missing.join(", ")
        );
        return refuse(
            path,
            message,
            "run the shards that are missing, and give their folders too",
        );
    }
    let whole = Campaign {
        shard: Shard::WHOLE,
        ..first.clone()
    };
    whole.check_folder(dir)?;
    let mut sources = Vec::with_capacity(shards.len());
    for (campaign, part) in shards.values() {
        match folder::published(part, campaign)? {
            Some(rows) => sources.push(rows),
            None => {
                let message = format!("shard {} is not at its end", campaign.shard);
                return refuse(part, message, "run it again: it goes on from where it was");
            }
        }
    }
    let (folder, whole) = Folder::take(dir, &whole)?;
    let published = publish(folder.dir(), &whole, &mut sources)?;
    folder.close()?;
    Ok(published)
}

fn shard(part: &Path) -> Result<Campaign, BadInput> {
    let Some(campaign) = Campaign::of_folder(part)? else {
        let help = "give folders that `muster campaign --shard` wrote";
        return Err(BadInput::without_excerpt(part, "holds no campaign", help));
    };
    campaign.check_program(part)?;
    Ok(campaign)
}

fn refuse<T>(path: &Path, message: String, help: &str) -> Result<T, CampaignError> {
    Err(BadInput::without_excerpt(path, message, help).into())
}

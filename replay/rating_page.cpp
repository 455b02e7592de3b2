#include "duet/replay/rating_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/policies/language.h"
#include "duet/replay/replay_source.h"
#include "duet/rows/groups/distinct_episodes.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

std::vector<const EpisodeRow*> kept_rows(const Run& run) {
  std::vector<const EpisodeRow*> rows = distinct_episodes(run.rows);
  std::erase_if(rows, [&](const EpisodeRow* row) { return row->task == kWalkRows || !has_kept_recording(run, *row); });
  if (rows.empty())
    throw InputError(
        fmt::format("'{}': expected a run of interactions that kept trajectories (record.trajectories: all in its "
                    "suite), found none "
                    "in '{}/trajectories'",
                    run.path, run.path));
  return rows;
}

// A track whose motion alone is left.
ReplayTrack blind_track(ReplayTrack track) {
  track.kept.reset();
  track.name.clear();
  track.repeat.clear();
  track.origin.clear();
  track.recording.task.reset();  // no detector looks at it
  track.recording.contacts.clear();
  track.recording.reference.clear();
  track.recording.outcome = Outcome::kOk;
  track.recording.message.clear();
  return track;
}

ReplayScene blind_scene(const EpisodeRow& row, ReplayTrack track) {
  ReplayScene scene;
  scene.id = row.key;
  scene.name = task_prompt(parse_task(row.task));
  scene.tracks.push_back(blind_track(std::move(track)));
  return scene;
}

}  // namespace

std::vector<const EpisodeRow*> rated_rows(const std::vector<const EpisodeRow*>& rows, int count, std::uint64_t seed) {
  const std::string draw = std::to_string(seed);
  std::vector<const EpisodeRow*> drawn = rows;
  const auto rank = [&](const EpisodeRow* row) { return stream_key({"rate", draw, row->key}); };
  std::ranges::sort(drawn, {}, rank);
  std::map<std::string, int> seen;
  std::map<const EpisodeRow*, int> place;  // of an episode among those of its task
  for (const EpisodeRow* row : drawn) place[row] = seen[row->task]++;
  std::ranges::stable_sort(drawn, {}, [&](const EpisodeRow* row) { return place[row]; });
  drawn.resize(std::min(drawn.size(), static_cast<std::size_t>(count)));
  std::ranges::sort(drawn, {}, rank);
  return drawn;
}

ReplayContent rating_content(const Run& run, const RatingChoice& choice, Progress& progress) {
  const std::vector<const EpisodeRow*> rows = rated_rows(kept_rows(run), choice.count, choice.seed);
  ReplayChoice episodes;
  episodes.card = choice.card;
  for (const EpisodeRow* row : rows) episodes.episodes.push_back(row->key);
  ReplayContent seen = replay_of_run(run, episodes, progress);
  std::map<std::string, ReplayTrack> tracks;
  for (ReplayScene& scene : seen.scenes)
    for (ReplayTrack& track : scene.tracks) tracks[track.kept->row.key] = std::move(track);
  ReplayContent content;
  for (const EpisodeRow* row : rows) content.scenes.push_back(blind_scene(*row, std::move(tracks.at(row->key))));
  return content;
}

std::string rating_page(const ReplayContent& content, const ViewerBundle& viewer) {
  return viewer_page({.title = "Rating",
                      .heading = "Did the robot do it?",
                      .without_script = "This page needs JavaScript, which is off.",
                      .footer = ""},
                     content, viewer);
}

}  // namespace duet

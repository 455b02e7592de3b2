// The page of a replay: one HTML file that opens from disk without a network. The viewer (viewer/) stands in it whole;
// numbers as a deflated block, schema `duet.replay/1` (docs/file-formats.md, "Replay page"). Without JavaScript or
// WebGL its table of episodes stays.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "duet/experiment/work/run_work.h"
#include "duet/replay/replay_content.h"
#include "duet/replay/replay_source.h"
#include "duet/report/page/html_page.h"
#include "duet/report/page/html_report.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Texts around the data of a page that a viewer draws.
struct ViewerPage {
  std::string title, heading, without_script;  // text
  std::string footer;                          // HTML
};
std::string viewer_page(const ViewerPage& page, const ReplayContent& content, const ViewerBundle& viewer);

// "duet.replay/1": the header with its columns, as the page holds them before they are deflated.
std::string replay_data(const ReplayContent& content);

std::string replay_page(const ReplayContent& content, const ViewerBundle& viewer);

// The scenes in parts of at most `most` bytes a page, in order; a scene that alone is more has a page of its own.
inline constexpr std::size_t kMostPageBytes = 10'000'000;
struct ReplayPage {
  std::string html;
  std::vector<std::string> scenes;  // ids
};
std::vector<ReplayPage> replay_pages(const ReplayContent& content, const ViewerBundle& viewer,
                                     std::size_t most = kMostPageBytes);

// The page of `duet rate`: episodes of a run in 3-D, one at a time, for a person who is to say whether the robot did
// what it was asked to. It is blind: neither its text nor its data name a policy, an engine, a controller, a clip, a
// verdict or a force, and an episode is known by its key alone.

struct RatingChoice {
  int count = 50;          // episodes at most
  std::uint64_t seed = 1;  // draws the episodes and their order
  std::string card = {};   // as ReplayChoice::card
};

// Episodes drawn from `rows`, about as many of each task, in the order in which they are shown. Both depend on the seed
// and the keys alone, not on the order of rows. Fewer where there are not so many.
std::vector<const EpisodeRow*> rated_rows(const std::vector<const EpisodeRow*>& rows, int count, std::uint64_t seed);

// A scene per episode: its id is the key, its name the task's prompt, its one track the motions of robot and partner.
// Draws from the episodes whose recordings the run has kept; of equal ones (rows/groups/row_groups.h) one.
// Throws InputError for a run that has kept none, and as replay_of_run for a recording that cannot be shown.
ReplayContent rating_content(const Run& run, const RatingChoice& choice, Progress& progress);

// `viewer`: load_viewer("rate").
std::string rating_page(const ReplayContent& content, const ViewerBundle& viewer);

// The replays that a report leads to: pages beside it, of the clips on which engines and policies agree least.

// Calls `write` with the name ("replay.html", "replay-2.html") and the text of each page. Throws as replay_of_run.
std::vector<ReportReplay> report_replays(const Run& run, const ReplayChoice& choice, const ViewerBundle& viewer,
                                         const std::function<void(const std::string&, const std::string&)>& write,
                                         Progress& progress);

}  // namespace duet

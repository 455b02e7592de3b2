#include "duet/replay/report_replays.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/report/ranking/leaderboard_rows.h"

namespace duet {
namespace {

ReportReplay entry_of(const ReplayScene& scene, const std::string& file) {
  ReportReplay entry{.file = file,
                     .scene = scene.id,
                     .name = fmt::format("{}, {}", task_title(scene.task), scene.name),
                     .successes = scene.successes,
                     .judged = scene.judged,
                     .keys = {}};
  for (const ReplayTrack& track : scene.tracks)
    if (track.kept) entry.keys.push_back(track.kept->row.key);
  return entry;
}

}  // namespace

std::vector<ReportReplay> report_replays(const Run& run, const ReplayChoice& choice, const ViewerBundle& viewer,
                                         const std::function<void(const std::string&, const std::string&)>& write,
                                         Progress& progress) {
  const ReplayContent content = replay_of_run(run, choice, progress);
  std::vector<ReportReplay> replays;
  const std::vector<ReplayPage> pages = replay_pages(content, viewer);
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const std::string file = i == 0 ? "replay.html" : fmt::format("replay-{}.html", i + 1);
    write(file, pages[i].html);
    for (const std::string& id : pages[i].scenes)
      replays.push_back(entry_of(*std::ranges::find(content.scenes, id, &ReplayScene::id), file));
  }
  return replays;
}

}  // namespace duet

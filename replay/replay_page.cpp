#include "duet/replay/replay_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>

#include "duet/archives/zip/zip.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/policies/language.h"
#include "duet/replay/replay_header.h"
#include "duet/replay/replay_source.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/tables/line_plot.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

std::string verdict_text(const ReplayTrack& track) {
  if (!track.kept || !track.kept->row.success) return "not judged";
  return *track.kept->row.success ? "success" : "failure";
}

std::string rows_html(const ReplayScene& scene) {
  std::string html;
  for (const ReplayTrack& track : scene.tracks)
    html += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td><code>{}</code></td></tr>\n",
                        escape_html(scene.id), escape_html(track.name), verdict_text(track),
                        escape_html(std::string(to_string(track.recording.outcome))), escape_html(track.repeat));
  return html;
}

// Stands without a script.
std::string table_html(const ReplayContent& content) {
  std::string html =
      "<details id=\"all-episodes\" open><summary>All episodes of this page</summary><div class=\"scroll\" "
      "tabindex=\"0\" "
      "role=\"region\" aria-label=\"All episodes\"><table><thead><tr><th scope=\"col\">Episode</th><th scope=\"col\">"
      "Track</th><th scope=\"col\">Verdict</th><th scope=\"col\">Outcome</th><th scope=\"col\">Run it again</th></tr>"
      "</thead><tbody>\n";
  for (const ReplayScene& scene : content.scenes) html += rows_html(scene);
  html += "</tbody></table></div></details>\n";
  for (const std::string& note : content.notes) html += fmt::format("<p class=\"note\">{}</p>\n", escape_html(note));
  return html;
}

ReplayContent part_of(const ReplayContent& content, std::size_t begin, std::size_t end) {
  ReplayContent part = content;
  part.scenes.assign(content.scenes.begin() + static_cast<std::ptrdiff_t>(begin),
                     content.scenes.begin() + static_cast<std::ptrdiff_t>(end));
  return part;
}

ReplayPage page_of(const ReplayContent& part, const ViewerBundle& viewer) {
  ReplayPage page{replay_page(part, viewer), {}};
  for (const ReplayScene& scene : part.scenes) page.scenes.push_back(scene.id);
  return page;
}

}  // namespace

std::string replay_data(const ReplayContent& content) {
  ReplayColumns columns;
  const std::string header = dumped(replay_header(content, columns));
  std::string size;
  for (int byte = 0; byte < 4; ++byte)
    size.push_back(static_cast<char>(static_cast<std::uint32_t>(header.size()) >> (8 * byte) & 0xff));
  return size + header + columns.bytes();
}

std::string viewer_page(const ViewerPage& page, const ReplayContent& content, const ViewerBundle& viewer) {
  const std::string body = fmt::format(
      "<header id=\"head\"><h1>{}</h1></header>\n"
      "<main id=\"app\"><noscript><p class=\"note\">{}</p></noscript></main>\n<footer>{}</footer>\n",
      escape_html(page.heading), escape_html(page.without_script), page.footer);
  return html_page(page.title, body,
                   {"duet-replay", "application/octet-stream", base64(deflated(replay_data(content)))}, viewer);
}

std::string replay_page(const ReplayContent& content, const ViewerBundle& viewer) {
  return viewer_page(
      {.title = content.title + " - replay",
       .heading = content.title,
       .without_script = "This page draws its episodes by JavaScript, which is off: here is their table.",
       .footer = table_html(content)},
      content, viewer);
}

std::vector<ReplayPage> replay_pages(const ReplayContent& content, const ViewerBundle& viewer, std::size_t most) {
  std::vector<ReplayPage> pages;
  ReplayPage page = page_of(content, viewer);
  if (page.html.size() <= most || content.scenes.size() <= 1) return {std::move(page)};
  // Halves of halves: each page is written out about as often as there are levels.
  const std::size_t middle = content.scenes.size() / 2;
  for (const ReplayContent& half : {part_of(content, 0, middle), part_of(content, middle, content.scenes.size())})
    for (ReplayPage& one : replay_pages(half, viewer, most)) pages.push_back(std::move(one));
  return pages;
}

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

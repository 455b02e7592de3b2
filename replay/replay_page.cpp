#include "duet/replay/replay_page.h"

#include <fmt/format.h>

#include <cstdint>

#include "duet/archives/zip/deflate.h"
#include "duet/replay/replay_columns.h"
#include "duet/replay/replay_header.h"
#include "duet/report/tables/escape_html.h"
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

}  // namespace duet

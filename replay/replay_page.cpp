#include "duet/replay/replay_page.h"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>

#include "duet/archives/zip/deflate.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/replay/replay_columns.h"
#include "duet/replay/replay_header.h"
#include "duet/report/tables/escape_html.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

// The file beside the program that was built, or where the shipped files are.
std::string viewer_file(const std::string& name) {
  std::error_code ignored;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  std::vector<std::string> places = {(program.parent_path() / "viewer" / name).string()};
  for (const std::string& share : share_folders()) places.push_back(fmt::format("{}/viewer/{}", share, name));
  try {
    return first_existing("viewer/" + name, places);
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{}; a build makes it where esbuild is installed", error.what()));
  }
}

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

// A script element's text ends at this, wherever it stands.
void require_embeddable(std::string_view text, std::string_view end, const char* what) {
  require(text.find(end) == std::string_view::npos, "{}: expected no '{}' in it", what, end);
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

ViewerBundle load_viewer(const std::string& page) {
  return {read_text(viewer_file(page + ".js")), read_text(viewer_file(page + ".css"))};
}

std::string replay_data(const ReplayContent& content) {
  ReplayColumns columns;
  const std::string header = dumped(replay_header(content, columns));
  std::string size;
  for (int byte = 0; byte < 4; ++byte)
    size.push_back(static_cast<char>(static_cast<std::uint32_t>(header.size()) >> (8 * byte) & 0xff));
  return size + header + columns.bytes();
}

std::string viewer_page(const ViewerPage& page, const ReplayContent& content, const ViewerBundle& viewer) {
  require_embeddable(viewer.script, "</script", "the viewer's script");
  require_embeddable(viewer.style, "</style", "the viewer's style sheet");
  return fmt::format(
             "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
             "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
             "<meta name=\"color-scheme\" content=\"light dark\"><meta name=\"generator\" content=\"duet\">"
             "<title>{}</title>\n<style>{}</style></head>\n<body>\n<header "
             "id=\"head\"><h1>{}</h1></header>\n"
             "<main id=\"app\"><noscript><p class=\"note\">{}</p></noscript></main>\n<footer>",
             escape_html(page.title), viewer.style, escape_html(page.heading), escape_html(page.without_script)) +
         page.footer +
         fmt::format(
             "</footer>\n<script type=\"application/octet-stream\" "
             "id=\"duet-replay\">{}</script>\n<script>{}</script>\n"
             "</body></html>\n",
             base64(deflated(replay_data(content))), viewer.script);
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

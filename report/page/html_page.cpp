#include "duet/report/page/html_page.h"

#include <fmt/format.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/report/tables/escape_html.h"

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

// A script element's text ends at this, wherever it stands.
void require_embeddable(std::string_view text, std::string_view end, const char* what) {
  require(text.find(end) == std::string_view::npos, "{}: expected no '{}' in it", what, end);
}

}  // namespace

ViewerBundle load_viewer(const std::string& page) {
  return {read_text(viewer_file(page + ".js")), read_text(viewer_file(page + ".css"))};
}

ViewerBundle viewer_or_plain(const std::string& page, std::vector<std::string>& notes) {
  try {
    return load_viewer(page);
  } catch (const MissingError& error) {
    notes.push_back(fmt::format("The page has plain tables and no plots: {}.", error.what()));
    return {};
  }
}

std::string html_page(std::string_view title, std::string_view body, const PageData& data, const ViewerBundle& viewer) {
  require_embeddable(viewer.script, "</script", "the viewer's script");
  require_embeddable(viewer.style, "</style", "the viewer's style sheet");
  require_embeddable(data.text, "</script", "the data of the page");
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
      "<meta name=\"color-scheme\" content=\"light dark\"><meta name=\"generator\" content=\"duet\">"
      "<title>{}</title>\n<style>{}</style></head>\n<body>\n{}"
      "<script type=\"{}\" id=\"{}\">{}</script>\n<script>{}</script>\n</body></html>\n",
      escape_html(title), viewer.style, body, data.type, data.id, data.text, viewer.script);
}

}  // namespace duet

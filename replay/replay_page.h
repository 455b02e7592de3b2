// The page of a replay: one HTML file that opens from disk without a network. The viewer (viewer/) stands in it whole;
// numbers as a deflated block, schema `duet.replay/1` (docs/file-formats.md, "Replay page"). Without JavaScript or
// WebGL its table of episodes stays.
#pragma once

#include <string>
#include <vector>

#include "duet/replay/replay_content.h"
#include "duet/report/page/html_page.h"

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

}  // namespace duet

#include "duet/datasets/clip_picture.h"

#include <fmt/format.h>

#include "duet/core/require.h"
#include "duet/report/page/key_frames.h"
#include "duet/report/tables/escape_html.h"

namespace duet {
namespace {

constexpr std::string_view kPictureStyle =
    "<style>.human{stroke:#2563a8}.robot{stroke:#c2410c}.far{opacity:.45}path,circle{fill:none;stroke-linecap:round}"
    "circle{stroke-width:30}.ground{stroke:#888}text{font-family:sans-serif;fill:#333}</style>";

StickFigure figure_of(const HumanMotion& motion, int frame, const std::string& label) {
  StickFigure figure{.label = label, .points = {}, .bones = {}};
  for (int j = 0; j < kSmplJoints; ++j) {
    figure.points.emplace_back(motion.joints.at(frame, j));
    if (kSmplParents[j] >= 0) figure.bones.emplace_back(kSmplParents[j], j);
  }
  return figure;
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

}  // namespace

std::string clip_picture_svg(const InteractionClip& clip, const std::vector<int>& frames, const std::string& title) {
  std::vector<KeyFrame> key_frames;
  for (const int frame : frames) {
    require(frame >= 0 && frame < clip.frames(), "picture of clip '{}': frame {} is not among its {}", clip.id, frame,
            clip.frames());
    key_frames.push_back({.label = fmt::format("frame {} ({:.2f} s)", frame, frame / clip.rate_hz()),
                          .figures = {figure_of(clip.actor_motion(), frame, "human"),
                                      figure_of(clip.reactor_motion(), frame, "robot")}});
  }
  std::string svg = key_frames_svg(key_frames);
  if (svg.empty()) return svg;
  replace_all(svg, ">human<", ">stays human<");
  replace_all(svg, ">robot<", ">becomes the robot<");
  svg.insert(4, R"( xmlns="http://www.w3.org/2000/svg")");
  svg.insert(svg.find('>') + 1, fmt::format("{}<title>{}</title>", kPictureStyle, escape_html(title)));
  return svg;
}

}  // namespace duet

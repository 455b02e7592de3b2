#include "duet/report/page/key_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "duet/report/tables/line_plot.h"

namespace duet {
namespace {

constexpr double kMargin = 0.22;       // [m] around the figures of a frame
constexpr double kNarrowest = 1.3;     // [m] a frame's least width, so that labels fit
constexpr double kWidest = 6.0;        // [m] beyond it a stray point is cut off rather than the figures made tiny
constexpr double kBelowGround = 0.42;  // [m] for labels
constexpr double kHeadRadius = 0.095;  // [m]
constexpr double kTickSpacing = 0.5;   // [m] on the ground

struct View {
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();    // of the screen, horizontal, from the human to the robot
  Eigen::Vector3d nearer = -Eigen::Vector3d::UnitY();  // towards the viewer
};

bool finite(const Eigen::Vector3d& p) { return p.allFinite(); }

std::optional<Eigen::Vector3d> centre(const StickFigure& figure) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Eigen::Vector3d& p : figure.points) {
    if (!finite(p)) continue;
    sum += p;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return Eigen::Vector3d(sum / count);
}

const StickFigure* labelled(const KeyFrame& frame, std::string_view label) {
  for (const StickFigure& figure : frame.figures) {
    if (figure.label == label) return &figure;
  }
  return nullptr;
}

// The line from the human to the robot, or between the first two figures where they have other labels; horizontal.
std::optional<Eigen::Vector3d> line_between_agents(const KeyFrame& frame) {
  const StickFigure* from = labelled(frame, "human");
  const StickFigure* to = labelled(frame, "robot");
  if ((from == nullptr || to == nullptr) && frame.figures.size() >= 2) {
    from = frame.figures.data();
    to = from + 1;
  }
  if (from == nullptr || to == nullptr) return std::nullopt;
  const std::optional<Eigen::Vector3d> start = centre(*from);
  const std::optional<Eigen::Vector3d> end = centre(*to);
  if (!start || !end) return std::nullopt;
  Eigen::Vector3d line = *end - *start;
  line.z() = 0.0;
  return line;
}

View view_of(const std::vector<KeyFrame>& frames) {
  Eigen::Vector3d line = Eigen::Vector3d::Zero();
  for (const KeyFrame& frame : frames) line += line_between_agents(frame).value_or(Eigen::Vector3d::Zero());
  View view;
  if (line.norm() > 1e-6) view.right = line.normalized();
  view.nearer = {view.right.y(), -view.right.x(), 0.0};  // right x up
  return view;
}

struct Window {
  double left = std::numeric_limits<double>::infinity(), right = -left, bottom = 0.0, top = 0.5;

  void include(double x, double z) {
    left = std::min(left, x);
    right = std::max(right, x);
    bottom = std::min(bottom, z);
    top = std::max(top, z);
  }
  [[nodiscard]] bool empty() const { return left > right; }
  [[nodiscard]] double width() const { return right - left; }
};

Window window_of(const KeyFrame& frame, const View& view) {
  Window window;
  for (const StickFigure& figure : frame.figures) {
    for (const Eigen::Vector3d& p : figure.points) {
      if (finite(p)) window.include(p.dot(view.right), p.z());
    }
  }
  return window;
}

// Places a point of one frame in the drawing, in whole millimetres.
struct Panel {
  const View& view;
  double offset;  // [m] added to the horizontal coordinate
  double top;     // [m] height of the upper edge

  [[nodiscard]] long x(double along) const { return std::lround(1000.0 * (along + offset)); }
  [[nodiscard]] long y(double height) const { return std::lround(1000.0 * (top - height)); }
  [[nodiscard]] long x(const Eigen::Vector3d& p) const { return x(p.dot(view.right)); }
  [[nodiscard]] long y(const Eigen::Vector3d& p) const { return y(p.z()); }
};

std::string style_class(const std::string& label) {
  return label == "human" || label == "robot" || label == "source" ? label : "other";
}

bool drawable(const StickFigure& figure, const std::pair<int, int>& bone) {
  const int count = static_cast<int>(figure.points.size());
  return bone.first >= 0 && bone.second >= 0 && bone.first < count && bone.second < count &&
         finite(figure.points[bone.first]) && finite(figure.points[bone.second]);
}

// The end point of the figure that is its head: the highest end of a chain of bones, if it stands over the body in the
// first frame. A raised hand is too far from the middle, and a figure without a head gets none.
std::optional<int> head_of(const StickFigure& figure) {
  const std::optional<Eigen::Vector3d> middle = centre(figure);
  if (!middle) return std::nullopt;
  std::vector<int> degree(figure.points.size(), 0);
  double top = -std::numeric_limits<double>::infinity();
  for (const auto& bone : figure.bones) {
    if (!drawable(figure, bone)) continue;
    ++degree[bone.first];
    ++degree[bone.second];
    top = std::max({top, figure.points[bone.first].z(), figure.points[bone.second].z()});
  }
  for (std::size_t i = 0; i < degree.size(); ++i) {
    const Eigen::Vector3d& p = figure.points[i];
    if (degree[i] == 1 && p.z() > top - 1e-9 && (p - *middle).head<2>().norm() < 0.2) return static_cast<int>(i);
  }
  return std::nullopt;
}

// Limbs on the far side are drawn weaker, which tells left from right in a side view.
std::string bones_path(const StickFigure& figure, const Panel& panel, double middle_depth, bool far) {
  std::string path;
  for (const auto& bone : figure.bones) {
    if (!drawable(figure, bone)) continue;
    const Eigen::Vector3d& a = figure.points[bone.first];
    const Eigen::Vector3d& b = figure.points[bone.second];
    const bool is_far = 0.5 * (a + b).dot(panel.view.nearer) < middle_depth - 0.03;
    if (is_far == far) path += fmt::format("M{} {}L{} {}", panel.x(a), panel.y(a), panel.x(b), panel.y(b));
  }
  return path;
}

std::string figure_svg(const StickFigure& figure, const Panel& panel, std::optional<int> head) {
  const std::optional<Eigen::Vector3d> middle = centre(figure);
  if (!middle) return "";
  const double depth = middle->dot(panel.view.nearer);
  const bool faint = figure.label == "source";
  const std::string name = style_class(figure.label);
  std::string svg =
      fmt::format(R"(<g stroke-width="{}"><title>{}</title>)", faint ? 18 : 34, escape_html(figure.label));
  const char* dash = faint ? R"( stroke-dasharray="50 40")" : "";
  if (const std::string path = bones_path(figure, panel, depth, true); !path.empty()) {
    svg += fmt::format(R"(<path class="{} far"{} d="{}"/>)", name, dash, path);
  }
  if (const std::string path = bones_path(figure, panel, depth, false); !path.empty()) {
    svg += fmt::format(R"(<path class="{}"{} d="{}"/>)", name, dash, path);
  }
  if (head && *head < static_cast<int>(figure.points.size()) && finite(figure.points[*head])) {
    const Eigen::Vector3d& p = figure.points[*head];
    svg += fmt::format(R"(<circle class="{}" cx="{}" cy="{}" r="{:.0f}"/>)", name, panel.x(p), panel.y(p),
                       1000.0 * kHeadRadius);
  }
  return svg + "</g>";
}

// The figures of a frame, farthest first; the source person behind all.
std::vector<std::size_t> drawing_order(const KeyFrame& frame, const View& view) {
  std::vector<std::size_t> order(frame.figures.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto depth = [&](std::size_t i) {
    if (frame.figures[i].label == "source") return -std::numeric_limits<double>::infinity();
    return centre(frame.figures[i]).value_or(Eigen::Vector3d::Zero()).dot(view.nearer);
  };
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return depth(a) < depth(b); });
  return order;
}

std::string ground_svg(const Panel& panel, const Window& window, double left, double right) {
  std::string svg = fmt::format(R"(<path class="ground" stroke-width="10" d="M{} {}H{}"/>)", panel.x(left),
                                panel.y(0.0), panel.x(right));
  std::string ticks;
  for (double at = std::ceil(left / kTickSpacing) * kTickSpacing; at <= right; at += kTickSpacing) {
    ticks += fmt::format("M{} {}v35", panel.x(at), panel.y(0.0));
  }
  // The ground covers what is under it only by a line: a foot that sinks in must be seen.
  if (window.bottom < -0.02) svg += fmt::format("<title>lowest point {:.0f} mm</title>", 1000.0 * window.bottom);
  return svg + fmt::format(R"(<path class="ground" stroke-width="8" d="{}"/>)", ticks);
}

std::string legend_svg(const std::vector<KeyFrame>& frames, double height_mm, double font) {
  std::vector<std::string> labels;
  for (const KeyFrame& frame : frames) {
    for (const StickFigure& figure : frame.figures) {
      if (std::find(labels.begin(), labels.end(), figure.label) == labels.end()) labels.push_back(figure.label);
    }
  }
  std::string svg;
  double x = 0.2 * font;
  for (const std::string& label : labels) {
    const bool faint = label == "source";
    svg += fmt::format(R"(<g stroke-width="{}"><path class="{}"{} d="M{:.0f} {:.0f}h{:.0f}"/></g>)", faint ? 18 : 34,
                       style_class(label), faint ? R"( stroke-dasharray="50 40")" : "", x, height_mm - 0.35 * font,
                       1.4 * font);
    x += 1.9 * font;
    svg += fmt::format(R"(<text x="{:.0f}" y="{:.0f}">{}</text>)", x, height_mm - 0.05 * font, escape_html(label));
    x += (0.62 * static_cast<double>(label.size()) + 1.5) * font;
  }
  return svg;
}

struct Layout {
  View view;
  std::vector<Window> windows;
  double frame_width = kNarrowest;  // [m] the same for all frames, so that they share a scale
  double top = 0.5, bottom = 0.0;   // [m]
};

Layout layout_of(const std::vector<KeyFrame>& frames) {
  Layout layout;
  layout.view = view_of(frames);
  for (const KeyFrame& frame : frames) {
    const Window window = window_of(frame, layout.view);
    layout.windows.push_back(window);
    if (window.empty()) continue;
    layout.frame_width = std::max(layout.frame_width, std::min(window.width() + 2.0 * kMargin, kWidest));
    layout.top = std::max(layout.top, std::min(window.top, 4.0));
    layout.bottom = std::min(layout.bottom, std::max(window.bottom, -0.5));
  }
  layout.top += 0.12 + kHeadRadius;
  return layout;
}

std::string frame_svg(const KeyFrame& frame, const Layout& layout, std::size_t place,
                      const std::vector<std::optional<int>>& heads) {
  const Window& window = layout.windows[place];
  const double middle = window.empty() ? 0.0 : 0.5 * (window.left + window.right);
  const double centre_x = (static_cast<double>(place) + 0.5) * layout.frame_width;
  const Panel panel{.view = layout.view, .offset = centre_x - middle, .top = layout.top};
  const double half = 0.5 * layout.frame_width - 0.06;
  std::string svg = ground_svg(panel, window, middle - half, middle + half);
  for (const std::size_t i : drawing_order(frame, layout.view)) {
    svg += figure_svg(frame.figures[i], panel, i < heads.size() ? heads[i] : std::nullopt);
  }
  return svg + fmt::format(R"(<text class="frame-label" x="{:.0f}" y="{:.0f}" text-anchor="middle">{}</text>)",
                           1000.0 * centre_x, 1000.0 * (layout.top - layout.bottom + 0.19), escape_html(frame.label));
}

}  // namespace

std::string key_frames_svg(const std::vector<KeyFrame>& frames) {
  const Layout layout = layout_of(frames);
  if (std::all_of(layout.windows.begin(), layout.windows.end(), [](const Window& w) { return w.empty(); })) return "";
  std::vector<std::optional<int>> heads;
  for (const StickFigure& figure : frames.front().figures) heads.push_back(head_of(figure));
  const double width = 1000.0 * layout.frame_width * static_cast<double>(frames.size());
  const double height = 1000.0 * (layout.top - layout.bottom + kBelowGround);
  const double font = height / 22.0;
  std::string svg = fmt::format(
      R"(<svg class="stage" viewBox="0 0 {:.0f} {:.0f}" font-size="{:.0f}" role="img" aria-label="Key frames, seen from the side">)",
      width, height, font);
  for (std::size_t i = 0; i < frames.size(); ++i) svg += frame_svg(frames[i], layout, i, heads);
  return svg + legend_svg(frames, height - 20.0, font) + "</svg>";
}

}  // namespace duet

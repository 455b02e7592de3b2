#include "duet/report/studies/attribution.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/report/ranking/policy_groups.h"

namespace duet {
namespace {

// An outcome that is counted in an episode.
struct CountedOutcome {
  std::string_view name, title;
  bool (*happened)(const EpisodeRow& row);
};
constexpr std::array<CountedOutcome, 2> kOutcomes = {{
    {"success", "Success", headline_success},
    {"falls", "Falls", [](const EpisodeRow& row) { return row.fell || row.outcome == Outcome::kDiverged; }},
}};

constexpr const char* kAllSwitches = "all switches";

std::string named(std::string_view figure, std::string_view outcome) { return fmt::format("{}_{}", figure, outcome); }

// One policy under one perturbation.
struct GroupKey {
  PolicyKey policy;
  std::string perturbation;
  auto operator<=>(const GroupKey&) const = default;
};

// The rows of an episode in each cell, none where a cell lacks it.
using CellRows = std::vector<const EpisodeRow*>;
using Group = std::map<EpisodeId, CellRows>;

std::map<GroupKey, Group> groups_of(const AttributionRows& rows) {
  std::map<GroupKey, Group> groups;
  for (std::size_t cell = 0; cell < rows.cells.size(); ++cell)
    for (const auto& [policy, perturbed] : rows_of_policies(rows.cells[cell]))
      for (const auto& [perturbation, episodes] : perturbed)
        for (const auto& [id, row] : episodes) {
          CellRows& cells = groups[{policy, perturbation}][id];
          cells.resize(rows.cells.size(), nullptr);
          cells[cell] = row;
        }
  for (auto& [key, group] : groups)
    std::erase_if(group, [](const auto& episode) { return std::ranges::count(episode.second, nullptr) > 0; });
  std::erase_if(groups, [](const auto& group) { return group.second.empty(); });
  if (groups.empty()) throw InputError("attribution: no episode is in all cells; run them to their end first");
  return groups;
}

FactorialOutcomes outcomes_of(const Group& group, int switches, const CountedOutcome& outcome) {
  FactorialOutcomes outcomes{
      .switches = switches, .cells = std::vector<std::vector<double>>(std::size_t{1} << switches), .clips = {}};
  ClipNumbers numbers;
  for (const auto& [id, cells] : group) {
    outcomes.clips.push_back(numbers.of(id));
    for (std::size_t cell = 0; cell < cells.size(); ++cell)
      outcomes.cells[cell].push_back(outcome.happened(*cells[cell]) ? 1.0 : 0.0);
  }
  return outcomes;
}

// The figures of one group, table by table.
struct Figures {
  Estimates way, switches, cells, held_out;
};

class GroupFigures {
 public:
  GroupFigures(const AttributionRows& rows, const AttributionOptions& options, const GroupKey& key, const Group& group,
               ClusterBootstrap& bootstrap, Figures& into)
      : rows_(rows), options_(options), group_(group), bootstrap_(bootstrap), into_(into) {
    keys_ = keys_of(key.policy);
    keys_.perturbation = key.perturbation;
  }

  void add() {
    for (const CountedOutcome& outcome : kOutcomes) add(outcome);
  }

 private:
  [[nodiscard]] int count() const { return static_cast<int>(rows_.switches.size()); }

  void add(const CountedOutcome& outcome) {
    const FactorialOutcomes outcomes = outcomes_of(group_, count(), outcome);
    add_cells(outcome, outcomes);
    add_way(outcome, outcomes);
    add_switches(outcome, outcomes);
    if (options_.holdout > 0.0) add_held_out(outcome, outcomes);
  }

  [[nodiscard]] EstimatesOf of(const std::string& what, Estimates& into) const {
    EstimatesOf estimates{keys_, into};
    estimates.keys.of = what;
    return estimates;
  }

  void add_contrast(const FactorialOutcomes& outcomes, const Contrast& contrast, const std::string& name,
                    const EstimatesOf& into) {
    const ContrastValue found = contrast_value(outcomes, contrast, options_, bootstrap_);
    into.add(name, outcomes.episodes(), found.value, found.interval);
  }

  void add_cells(const CountedOutcome& outcome, const FactorialOutcomes& outcomes) {
    for (std::size_t cell = 0; cell < outcomes.cells.size(); ++cell) {
      SuccessByClip counted;
      for (const auto& [id, cells] : group_) counted.add(id, outcome.happened(*cells[cell]) ? 1.0 : 0.0);
      of(rows_.cell_names[cell], into_.cells).rate(outcome.name, make_rate(counted, options_.level));
    }
  }

  // Every effect between the two ends, small sets first.
  void add_way(const CountedOutcome& outcome, const FactorialOutcomes& outcomes) {
    for (int size = 1; size <= count(); ++size)
      for (unsigned set = 1; set < outcomes.cells.size(); ++set)
        if (std::popcount(set) == size)
          add_contrast(outcomes, together_contrast(count(), set), named("effect", outcome.name),
                       of(set_name(rows_.switches, set), into_.way));
    add_contrast(outcomes, gap_contrast(count()), named("effect", outcome.name), of(kAllSwitches, into_.way));
  }

  void add_switches(const CountedOutcome& outcome, const FactorialOutcomes& outcomes) {
    const Contrast gap = gap_contrast(count());
    const Interval around = contrast_value(outcomes, gap, options_, bootstrap_).interval;
    const bool is_gap = around.low > 0.0 || around.high < 0.0;
    for (int i = 0; i < count(); ++i) {
      const EstimatesOf estimates = of(rows_.switches[static_cast<std::size_t>(i)], into_.switches);
      const auto add = [&](const char* figure, const Contrast& contrast) {
        add_contrast(outcomes, contrast, named(figure, outcome.name), estimates);
      };
      if (&outcome == &kOutcomes.front()) estimates.word("settings", rows_.settings[static_cast<std::size_t>(i)]);
      add("alone", together_contrast(count(), 1U << static_cast<unsigned>(i)));
      add("last", last_contrast(count(), i));
      add("main", main_contrast(count(), i));
      const Contrast shapley = shapley_contrast(count(), i);
      add("shapley", shapley);
      if (!is_gap) continue;
      const ContrastValue share = contrast_share(outcomes, shapley, gap, options_, bootstrap_);
      estimates.add(named("share", outcome.name), outcomes.episodes(), share.value, share.interval);
    }
  }

  // Clips are held out as a whole, drawn from the seed alone.
  [[nodiscard]] std::vector<bool> held_out(const FactorialOutcomes& outcomes) const {
    const std::set<int> clips(outcomes.clips.begin(), outcomes.clips.end());
    std::vector<int> order(clips.begin(), clips.end());
    Random random(options_.seed, stream_key({"attribution holdout"}));
    for (std::size_t i = 0; i + 1 < order.size(); ++i)
      std::swap(order[i], order[i + static_cast<std::size_t>(random.below(static_cast<int>(order.size() - i)))]);
    order.resize(static_cast<std::size_t>(std::lround(options_.holdout * static_cast<double>(order.size()))));
    const std::set<int> out(order.begin(), order.end());
    std::vector<bool> chosen(outcomes.clips.size());
    for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = out.contains(outcomes.clips[i]);
    return chosen;
  }

  // The switches that were found on the other clips, turned alone on these: their part of the gap.
  void add_held_out(const CountedOutcome& outcome, const FactorialOutcomes& outcomes) {
    const std::vector<bool> out = held_out(outcomes);
    std::vector<bool> in = out;
    in.flip();
    const FactorialOutcomes tuned = outcomes.only(in), unseen = outcomes.only(out);
    if (tuned.episodes() == 0 || unseen.episodes() == 0) return;
    const unsigned set = sufficient_set(tuned, kGapLeft);
    const EstimatesOf estimates = of(kAllSwitches, into_.held_out);
    add_contrast(unseen, gap_contrast(count()), named("gap_held_out", outcome.name), estimates);
    estimates.word(named("found", outcome.name), set == 0 ? "none: no gap" : set_name(rows_.switches, set, " + "));
    if (set == 0) return;
    Contrast part(outcomes.cells.size(), 0.0);
    part[0] = -1.0;
    part[set] = 1.0;
    const ContrastValue share = contrast_share(unseen, part, gap_contrast(count()), options_, bootstrap_);
    estimates.add(named("explained", outcome.name), unseen.episodes(), share.value, share.interval);
  }

  const AttributionRows& rows_;
  const AttributionOptions& options_;
  const Group& group_;
  ClusterBootstrap& bootstrap_;
  Figures& into_;
  Estimate keys_;
};

std::vector<RowLabel> labels_with(const char* title) {
  return policy_rows({{"Perturbation", &Estimate::perturbation}, {title, &Estimate::of, true}});
}

PivotColumn column_of(std::string title, const char* figure, std::string_view outcome, CellText cell) {
  return column(std::move(title), {.name = named(figure, outcome)}, std::move(cell));
}

TitledTable way_table(const Estimates& way, double level) {
  return table_of(
      way, {.title = "What makes the gap",
            .rows = labels_with("Effect"),
            .columns = {column_of("n", "effect", "success", as_n),
                        column_of("Success [points]", "effect", "success", as_points),
                        column_of("Falls [points]", "effect", "falls", as_points)},
            .notes = {fmt::format(
                "A switch by itself: that switch alone, against none. a x b: what both together do beyond the sum of "
                "each alone; of three beyond all smaller sets. The effects sum to the gap ({}). {:g} % intervals over "
                "the same episodes, by clip; where one contains 0 these episodes do not show the effect.",
                kAllSwitches, 100.0 * level)}});
}

TitledTable switch_table(const Estimates& switches) {
  return table_of(
      switches,
      {.title = "Switches",
       .rows = labels_with("Switch"),
       .columns = {column("Turns", {.name = "settings"}, as_word),
                   column_of("Alone [points]", "alone", "success", as_points),
                   column_of("Last [points]", "last", "success", as_points),
                   column_of("Mean effect [points]", "main", "success", as_points),
                   column_of("Shapley [points]", "shapley", "success", as_points),
                   column_of("Share of the gap [%]", "share", "success", as_percent),
                   column_of("Shapley, falls [points]", "shapley", "falls", as_points),
                   column_of("Share, falls [%]", "share", "falls", as_percent)},
       .notes = {
           "Success but where falls are named. Alone: with all others as they were. Last: with all others turned "
           "already, hence what turning it back would win. Mean effect: over all settings of the others. Shapley: "
           "over all orders in which they may be turned; these sum to the gap. A share stands where the gap's "
           "interval leaves 0 out."}});
}

TitledTable cell_table(const Estimates& cells, double level) {
  return table_of(cells, {.title = "Cells",
                          .rows = labels_with("Cell"),
                          .columns = {column("n", {.name = "success"}, as_n),
                                      column("Success [%]", {.name = "success"}, as_percent),
                                      column("Falls [%]", {.name = "falls"}, as_percent)},
                          .notes = {fmt::format("Each cell has the switches turned that it names; {:g} % Wilson "
                                                "intervals, by clip where a clip has several episodes.",
                                                100.0 * level)}});
}

TitledTable held_out_table(const Estimates& held_out, double share) {
  return table_of(
      held_out,
      {.title = "On clips that were held out",
       .rows = policy_rows({{"Perturbation", &Estimate::perturbation}, {nullptr, &Estimate::of}}),
       .columns = {column_of("n", "gap_held_out", "success", as_n),
                   column_of("Gap, success [points]", "gap_held_out", "success", as_points),
                   column_of("Found", "found", "success", as_word),
                   column_of("They explain [%]", "explained", "success", as_percent),
                   column_of("Gap, falls [points]", "gap_held_out", "falls", as_points),
                   column_of("Found, falls", "found", "falls", as_word),
                   column_of("They explain, falls [%]", "explained", "falls", as_percent)},
       .notes = {fmt::format(
           "{:g} % of the clips are held out. Found: on the others, the fewest switches that alone leave at most {:g} "
           "% "
           "of the gap there. They explain: their share of the gap on the held-out clips, with these switches turned "
           "and no other; 100 % by definition where all are needed.",
           100.0 * share, 100.0 * kGapLeft)}});
}

}  // namespace

Analysis attribution_analysis(const AttributionRows& rows, const AttributionOptions& options) {
  require(rows.cells.size() == std::size_t{1} << rows.switches.size() && rows.cell_names.size() == rows.cells.size() &&
              rows.settings.size() == rows.switches.size(),
          "attribution: expected 2^switches cells with their names, found {} of {} switches", rows.cells.size(),
          rows.switches.size());
  Analysis analysis{.name = "attribution", .title = "Attribution", .level = options.level};
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  Figures figures;
  for (const auto& [key, group] : groups_of(rows)) GroupFigures(rows, options, key, group, bootstrap, figures).add();
  analysis.tables = {way_table(figures.way, options.level), switch_table(figures.switches)};
  if (!figures.held_out.empty()) analysis.tables.push_back(held_out_table(figures.held_out, options.holdout));
  analysis.tables.push_back(cell_table(figures.cells, options.level));
  for (Estimates* part : {&figures.cells, &figures.way, &figures.switches, &figures.held_out})
    std::ranges::move(*part, std::back_inserter(analysis.estimates));
  return analysis;
}

// The figure: the way from the one end to the other, a bar an effect.

namespace {

struct Bar {
  std::string label;
  double begin = 0.0, end = 0.0;     // shares
  std::optional<Estimate> effect{};  // none of the two ends
};
struct Panel {
  std::string title;
  std::vector<Bar> bars;
};

bool same_group(const Estimate& a, const Estimate& b) {
  return a.engine == b.engine && a.controller == b.controller && a.policy == b.policy && a.arm == b.arm &&
         a.perturbation == b.perturbation;
}

Panel panel_of(const Analysis& analysis, const Estimate& group, const CountedOutcome& outcome) {
  Panel panel;
  std::vector<std::string> names;
  for (const std::string& name : {group.engine, group.controller, policy_title(group), group.perturbation})
    if (!name.empty() && name != kClean) names.push_back(name);
  panel.title = fmt::format("{} [%]: {}", outcome.title, fmt::join(names, ", "));
  std::optional<double> from, to;
  double at = 0.0;
  for (const Estimate& estimate : analysis.estimates) {
    if (!same_group(estimate, group)) continue;
    if (estimate.name == outcome.name) {
      if (!from) from = at = estimate.value;
      to = estimate.value;
    }
    if (estimate.name != named("effect", outcome.name) || estimate.of == kAllSwitches) continue;
    panel.bars.push_back({estimate.of, at, at + estimate.value, estimate});
    at += estimate.value;
  }
  panel.bars.insert(panel.bars.begin(), {"from", 0.0, from.value_or(0.0)});
  panel.bars.push_back({"to", 0.0, to.value_or(0.0)});
  return panel;
}

// One for each group and outcome.
std::vector<Panel> panels_of(const Analysis& analysis) {
  std::vector<Panel> panels;
  std::vector<Estimate> groups;
  for (const Estimate& estimate : analysis.estimates)
    if (std::ranges::none_of(groups, [&](const Estimate& known) { return same_group(known, estimate); }))
      groups.push_back(estimate);
  for (const Estimate& group : groups)
    for (const CountedOutcome& outcome : kOutcomes) panels.push_back(panel_of(analysis, group, outcome));
  return panels;
}

constexpr int kColumns = 50;  // of a share of 1

int column_at(double share) { return static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * kColumns)); }

// '#' of an end, '<' and '>' of an effect, '|' where it is none.
std::string bar_text(const Bar& bar) {
  std::string text(kColumns + 1, ' ');
  const int low = column_at(std::min(bar.begin, bar.end)), high = column_at(std::max(bar.begin, bar.end));
  const char sign = !bar.effect ? '#' : bar.end < bar.begin ? '<' : '>';
  for (int i = low; i < high; ++i) text[static_cast<std::size_t>(i)] = sign;
  if (low == high) text[static_cast<std::size_t>(low)] = '|';
  return text;
}

std::string value_text(const Bar& bar) { return bar.effect ? as_points(*bar.effect) : percent(bar.end); }

}  // namespace

std::string attribution_bars(const Analysis& analysis) {
  std::string text;
  for (const Panel& panel : panels_of(analysis)) {
    std::size_t width = 0;
    for (const Bar& bar : panel.bars) width = std::max(width, bar.label.size());
    text += panel.title + "\n";
    for (const Bar& bar : panel.bars)
      text += fmt::format("  {:<{}}  [{}] {}\n", bar.label, width, bar_text(bar), value_text(bar));
    text += "\n";
  }
  return text;
}

namespace {

constexpr int kBarHeight = 24, kTitleHeight = 44, kScale = 300, kValueWidth = 170;

constexpr const char* kBarStyle = R"(<style>
text{font:13px system-ui,sans-serif;fill:#1d2024}.s{fill:#5b626b;font-size:11px}.t{font-weight:600}.g{stroke:#d5d8dc}
.e{fill:#2a66a8}.d{fill:#b4531b}.u{fill:#3b8a5a}.w{stroke:#1d2024;stroke-width:1.5}.l{stroke:#8a9099;stroke-dasharray:2 2}
@media(prefers-color-scheme:dark){text{fill:#e7e8ea}.s{fill:#a6adb6}.g{stroke:#3a4048}.e{fill:#74aef0}.d{fill:#f0965a}
.u{fill:#7ccf9b}.w{stroke:#e7e8ea}}
</style>)";

double x_at(double share, int left) { return left + std::clamp(share, 0.0, 1.0) * kScale; }

std::string bar_svg(const Bar& bar, double next_from, bool is_last, int left, int y) {
  const double low = x_at(std::min(bar.begin, bar.end), left), high = x_at(std::max(bar.begin, bar.end), left);
  const char* kind = !bar.effect ? "e" : bar.end < bar.begin ? "d" : "u";
  std::string svg = fmt::format(
      R"(<text x="{}" y="{}" text-anchor="end">{}</text><rect class="{}" x="{:.1f}" y="{}" width="{:.1f}" height="14"/>)",
      left - 10, y + 12, escape_html(bar.label), kind, low, y, std::max(high - low, 1.5));
  if (bar.effect && std::isfinite(bar.effect->interval.low))
    svg += fmt::format(R"(<line class="w" x1="{:.1f}" x2="{:.1f}" y1="{}" y2="{}"/>)",
                       x_at(bar.begin + bar.effect->interval.low, left),
                       x_at(bar.begin + bar.effect->interval.high, left), y + 7, y + 7);
  if (!is_last)
    svg += fmt::format(R"(<line class="l" x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}"/>)", x_at(next_from, left),
                       y + 14, y + kBarHeight);
  return svg + fmt::format(R"(<text x="{}" y="{}">{}</text>)", left + kScale + 10, y + 12, value_text(bar));
}

std::string panel_svg(const Panel& panel, int left, int top) {
  const int count = static_cast<int>(panel.bars.size()), bottom = top + kTitleHeight + count * kBarHeight;
  std::string svg = fmt::format(R"(<text class="t" x="10" y="{}">{}</text>)", top + 14, escape_html(panel.title));
  for (int tick = 0; tick <= 100; tick += 25)
    svg += fmt::format(
        R"(<line class="g" x1="{0}" x2="{0}" y1="{1}" y2="{2}"/><text class="s" x="{0}" y="{3}" text-anchor="middle">{4}</text>)",
        left + tick * kScale / 100, top + kTitleHeight - 8, bottom - 6, top + kTitleHeight - 12, tick);
  for (int i = 0; i < count; ++i) {
    const Bar& bar = panel.bars[static_cast<std::size_t>(i)];
    svg += bar_svg(bar, bar.end, i + 1 == count, left, top + kTitleHeight + i * kBarHeight);
  }
  return svg;
}

}  // namespace

std::string attribution_svg(const Analysis& analysis) {
  const std::vector<Panel> panels = panels_of(analysis);
  std::size_t longest = 4;
  for (const Panel& panel : panels)
    for (const Bar& bar : panel.bars) longest = std::max(longest, bar.label.size());
  const int left = 24 + static_cast<int>(7.2 * static_cast<double>(longest));
  int top = 4;
  std::string body;
  for (const Panel& panel : panels) {
    body += panel_svg(panel, left, top);
    top += kTitleHeight + static_cast<int>(panel.bars.size()) * kBarHeight + 14;
  }
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" aria-label="The way from one setting to the other: an effect a bar">{2}{3}</svg>)"
      "\n",
      left + kScale + kValueWidth, top, kBarStyle, body);
}

}  // namespace duet

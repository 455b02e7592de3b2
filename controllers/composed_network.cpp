#include "duet/controllers/composed_network.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

class ComposedNetwork final : public Network {
 public:
  ComposedNetwork(const Descriptor& descriptor, std::vector<std::unique_ptr<Network>> networks)
      : networks_(std::move(networks)) {
    for (std::size_t n = 0; n < networks_.size(); ++n) {
      const std::string owner = n < descriptor.networks.size() ? descriptor.networks[n].name + "." : "";
      for (const Port& port : networks_[n]->inputs()) inputs_.push_back({owner + port.name, port.size});
      for (const Port& port : networks_[n]->outputs()) outputs_.push_back({owner + port.name, port.size});
      last_input_.push_back(inputs_.size());
      last_output_.push_back(outputs_.size());
    }
    shown_.resize(inputs_.size());
    own_.resize(inputs_.size());
    for (const ObservationInput& input : descriptor.observation.inputs) link(descriptor, input);
  }

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    std::size_t input = 0, output = 0, link = 0;
    for (std::size_t n = 0; n < networks_.size(); ++n) {
      const std::size_t first_input = input, first_output = output;
      for (; input < last_input_[n]; ++input) {
        shown_[input] = inputs[input];
        if (own_[input].empty()) continue;
        std::ranges::copy(inputs[input], own_[input].begin());
        for (; link < links_.size() && links_[link].input == input; ++link)
          std::ranges::copy(outputs[links_[link].output], own_[input].begin() + links_[link].place);
        shown_[input] = own_[input];
      }
      output = last_output_[n];
      networks_[n]->run(std::span(shown_).subspan(first_input, input - first_input),
                        outputs.subspan(first_output, output - first_output));
    }
  }

  void reset() override {
    for (const std::unique_ptr<Network>& network : networks_) network->reset();
  }

 private:
  // Numbers of an output within an input of the same run.
  struct Link {
    std::size_t input = 0, output = 0;
    int place = 0;
  };

  // The network that has a port, by the ends of all networks' ports.
  static std::size_t owner(const std::vector<std::size_t>& ends, std::size_t port) {
    return static_cast<std::size_t>(std::ranges::upper_bound(ends, port) - ends.begin());
  }

  // An input that no network has is refused where it is bound.
  void link(const Descriptor& descriptor, const ObservationInput& input) {
    const auto found = std::ranges::find(inputs_, input.name, &Port::name);
    int place = 0;
    for (const InputPart& part : input.parts) {
      const int size = part.history.frames * descriptor.observation.part_size(part, descriptor.widths());
      if (!part.from.empty() && found != inputs_.end())
        add(descriptor, part, {static_cast<std::size_t>(found - inputs_.begin()), 0, place});
      place += size;
    }
    std::ranges::stable_sort(links_, {}, &Link::input);
  }

  void add(const Descriptor& descriptor, const InputPart& part, Link link) {
    const auto fail = [&](const std::string& problem) {
      throw InputError(fmt::format("{}:{}: {}", descriptor.file, part.line, problem));
    };
    const auto output = std::ranges::find(outputs_, part.from, &Port::name);
    if (output == outputs_.end()) fail(unknown_name_message("output", part.from, names_of(outputs_)));
    link.output = static_cast<std::size_t>(output - outputs_.begin());
    if (output->size != part.size)
      fail(fmt::format("output '{}': expected a size of {}, found {}", part.from, output->size, part.size));
    if (owner(last_output_, link.output) >= owner(last_input_, link.input))
      fail(fmt::format("input '{}': expected an output of a network that runs before, found '{}'",
                       inputs_[link.input].name, part.from));
    own_[link.input].resize(static_cast<std::size_t>(inputs_[link.input].size));
    links_.push_back(link);
  }

  std::vector<std::unique_ptr<Network>> networks_;
  std::vector<Port> inputs_, outputs_;                 // of all networks, one after another
  std::vector<std::size_t> last_input_, last_output_;  // behind each network's last
  std::vector<std::span<const float>> shown_;
  std::vector<std::vector<float>> own_;  // of inputs that have a link; empty for others
  std::vector<Link> links_;              // by input
};

}  // namespace

std::unique_ptr<Network> compose_networks(const Descriptor& descriptor,
                                          std::vector<std::unique_ptr<Network>> networks) {
  return std::make_unique<ComposedNetwork>(descriptor, std::move(networks));
}

}  // namespace duet

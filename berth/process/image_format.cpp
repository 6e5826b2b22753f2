#include "berth/process/image_format.hpp"

#include <atomic>
#include <map>
#include <new>

namespace berth::process {

namespace {

constexpr std::uint32_t mark = 0x4D49'4250;  // "PBIM"
constexpr std::uint32_t version = 1;

struct Head {
  std::atomic<std::uint32_t> mark;
  std::uint32_t version;
  std::uint64_t size;
  std::uint32_t variables;
  std::uint32_t table;  ///< bytes
};
static_assert(std::is_standard_layout_v<Head> && sizeof(Head) <= BlockLayout::line);

/// One row of the table; its name follows.
struct Row {
  std::uint32_t offset;
  std::uint16_t type;
  std::uint8_t direction;
  std::uint8_t name;  ///< bytes
};

std::vector<std::uint8_t> table_of(const Layout& layout) {
  std::vector<std::uint8_t> table;
  for (const auto& variable : layout.variables()) {
    const Row row{variable.offset, static_cast<std::uint16_t>(variable.type),
                  static_cast<std::uint8_t>(variable.direction), static_cast<std::uint8_t>(variable.name.size())};
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(&row);
    table.insert(table.end(), bytes, bytes + sizeof(row));
    table.insert(table.end(), variable.name.begin(), variable.name.end());
  }
  return table;
}

/// Adds the runs of variables in the part that begins at `at`. A run includes gaps shorter than a line.
void add_runs(const Layout& layout, Direction direction, std::size_t at, std::vector<Run>& runs) {
  std::map<std::uint32_t, std::uint32_t> places;
  for (const auto& variable : layout.variables()) {
    if (variable.direction == direction) {
      places.emplace(variable.offset, static_cast<std::uint32_t>(od::byte_size(variable.type)));
    }
  }
  for (const auto& [offset, size] : places) {
    const auto begin = static_cast<std::uint32_t>(at) + offset;
    if (!runs.empty() && begin <= runs.back().at + runs.back().size + BlockLayout::line) {
      runs.back().size = begin + size - runs.back().at;
    } else {
      runs.push_back({begin, size});
    }
  }
}

}  // namespace

ImageFormat::ImageFormat(const Layout& layout)
    : table_(table_of(layout)), variables_(static_cast<std::uint32_t>(layout.variables().size())) {
  const auto heads = status_at + layout.count(Direction::output) * sizeof(OutputStatus);
  output_values_at_ = BlockLayout::up(heads);
  outputs_.size = static_cast<std::uint32_t>(output_values_at_ + layout.size(Direction::output));
  outputs_.runs.push_back({0, static_cast<std::uint32_t>(heads)});
  add_runs(layout, Direction::output, output_values_at_, outputs_.runs);
  inputs_.size = static_cast<std::uint32_t>(input_values_at + layout.size(Direction::input));
  inputs_.runs.push_back({0, static_cast<std::uint32_t>(input_values_at)});
  add_runs(layout, Direction::input, input_values_at, inputs_.runs);
  outputs_at_ = BlockLayout::up(BlockLayout::line + table_.size());
  inputs_at_ = outputs_at_ + outputs_.memory();
}

void ImageFormat::begin(std::uint8_t* memory) const noexcept {
  auto* const head = new (memory) Head{};
  head->version = version;
  head->size = size();
  head->table = static_cast<std::uint32_t>(table_.size());
  head->variables = variables_;
  if (!table_.empty()) std::memcpy(memory + BlockLayout::line, table_.data(), table_.size());
  new (outputs(memory)) Owners::Word(Owners::initial);
  new (inputs(memory)) Owners::Word(Owners::initial);
  head->mark.store(mark, std::memory_order_release);
}

tl::expected<Layout, std::string> read_layout(std::span<const std::uint8_t> memory) {
  const auto refused = [](const char* why) { return tl::unexpected<std::string>(why); };
  if (memory.size() < sizeof(Head)) return refused("it is being made; try again");
  const auto* const head = reinterpret_cast<const Head*>(memory.data());
  if (head->mark.load(std::memory_order_acquire) != mark) return refused("it is being made, or is no image; try again");
  if (head->version != version) {
    return refused("it is of another version of Berth; build both programs with the same version");
  }
  constexpr auto damaged = "it is damaged; start the program of the device anew";
  if (head->size != memory.size() || head->table > memory.size() - BlockLayout::line) return refused(damaged);
  auto table = memory.subspan(BlockLayout::line, head->table);
  Layout layout;
  for (std::uint32_t i = 0; i < head->variables; ++i) {
    Row row{};
    if (table.size() < sizeof(row)) return refused(damaged);
    std::memcpy(&row, table.data(), sizeof(row));
    table = table.subspan(sizeof(row));
    if (table.size() < row.name || row.direction > BERTH_OUTPUT) return refused(damaged);
    const std::string name(reinterpret_cast<const char*>(table.data()), row.name);
    table = table.subspan(row.name);
    const bool good =
        layout.declare_at(name, static_cast<od::DataType>(row.type), static_cast<Direction>(row.direction), row.offset);
    if (!good) return refused(damaged);
  }
  if (ImageFormat(layout).size() != memory.size()) return refused(damaged);
  return layout;
}

}  // namespace berth::process

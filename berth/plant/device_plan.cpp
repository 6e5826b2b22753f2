#include "berth/plant/device_plan.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "berth/base/part_file.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/device/mandatory.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/multilevel/hardware_version.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/notation.hpp"
#include "berth/plant/sim_gateway.hpp"
#include "berth/text/file.hpp"

namespace berth::plant {
namespace {

constexpr rt::Duration bus_off_recovery = std::chrono::milliseconds(100);  // then a device restarts its controller
constexpr std::string_view state_header = "berth-plant-state 1";

bool remembers(NodeIdSource source) noexcept {
  return source == NodeIdSource::blank || source == NodeIdSource::nonvolatile;
}

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const auto byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

std::optional<std::vector<std::uint8_t>> unhex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    std::uint8_t byte = 0;
    const auto [end, error] = std::from_chars(text.data() + i, text.data() + i + 2, byte, 16);
    if (error != std::errc{} || end != text.data() + i + 2) return std::nullopt;
    bytes.push_back(byte);
  }
  return bytes;
}

std::uint8_t highest_slave(const PlantMaster& master) noexcept {
  if (!master.flying) return master.most;
  return static_cast<std::uint8_t>(master.slaves.empty() ? 1 : std::clamp(master.slaves.back(), 1U, 127U));
}

/// How a minimal device's dictionary differs from the minimal one. No file has such a name.
std::string own_objects(const PlantDevice& plan) {
  if (plan.does.master) {
    return fmt::format("{} of {}, hardware {}", plan.does.master->flying ? "flying master" : "master",
                       highest_slave(*plan.does.master), plan.does.hardware);
  }
  std::string programs = plan.does.hardware > 0 ? fmt::format("hardware {} ", plan.does.hardware) : std::string();
  if (plan.storing.programs.count > 0) programs += fmt::format("programs {} ", plan.storing.programs.count);
  if (plan.storing.needs_first_save) programs += "storage ";
  if (!plan.node_id_object.object) return programs;
  std::string text = programs + "node-ID object " + od::write_object(*plan.node_id_object.object);
  if (const auto& s = plan.node_id_object.signature)
    text += fmt::format(" {} {}", od::write_object(s->object), s->size);
  return text;
}

void add_object(od::DescriptionBuilder& b, ObjectRef ref, std::string_view name, unsigned size) {
  using od::DataType;
  constexpr std::array<DataType, 8> types{DataType::unsigned8,  DataType::unsigned16, DataType::unsigned24,
                                          DataType::unsigned32, DataType::unsigned40, DataType::unsigned48,
                                          DataType::unsigned56, DataType::unsigned64};
  const DataType type = types.at(size - 1);
  if (ref.sub == 0) {
    b.variable(ref.index, {.name = name, .type = type, .initial = od::Literal::number(0)});
  } else {
    b.object(ref.index, od::ObjectCode::record, name);
    b.sub(ref.index, {.sub = ref.sub, .name = name, .type = type, .initial = od::Literal::number(0)});
  }
}

std::shared_ptr<const od::Description> with_own_objects(const PlantDevice& plan, unsigned signals) {
  od::DescriptionBuilder b;
  device::add_device(b);
  add_signals(b, signals);
  if (plan.does.hardware > 0) multilevel::add_hardware_version(b, plan.does.hardware);
  if (plan.storing.needs_first_save) device::add_storage(b);
  if (plan.storing.programs.count > 0) device::add_programs(b, static_cast<std::uint8_t>(plan.storing.programs.count));
  if (!plan.node_id_object.object) return b.build();
  add_object(b, *plan.node_id_object.object, "Node-ID", 1);
  if (const auto& s = plan.node_id_object.signature) add_object(b, s->object, "Node-ID signature", s->size);
  return b.build();
}

std::shared_ptr<const od::Description> with_manager(const PlantBehaviour& does, unsigned signals) {
  const PlantMaster& master = *does.master;
  od::DescriptionBuilder b;
  const std::uint8_t most = highest_slave(master);
  device::add_device(b, {.supervised = std::max<std::uint8_t>(most, 8)});
  network::ManagerObjects objects{.most = most, .startup = 0x21, .longest_concise = 0, .flying = true};
  constexpr std::uint32_t room_for_a_configuration = 16'384;
  if (!master.flying) device::add_storage(b);
  if (!master.flying) objects = {.most = most, .longest_concise = room_for_a_configuration, .node_ids = true};
  network::add_manager_objects(b, objects);
  if (!master.flying) multilevel::add_expected_hardware(b, most);
  if (does.hardware > 0) multilevel::add_hardware_version(b, does.hardware);
  add_signals(b, signals);
  return b.build();
}

void preset_network_list(const PlantMaster& master, device::Options& options) {
  constexpr std::uint32_t assigned_and_booted = 0x05, keep_alive = 0x10;
  constexpr std::uint32_t heartbeat_time_ms = 1500;  // of a device with the machine file's default period
  options.presets.push_back({{0x1F90, 3}, master.priority});
  std::uint8_t entry = 0;
  for (const unsigned id : master.slaves) {
    const auto sub = static_cast<std::uint8_t>(id);
    options.presets.push_back(
        {{od::cia302::slave_assignment, sub}, assigned_and_booted | (master.keep_alive ? keep_alive : 0U)});
    options.presets.push_back({{0x1016, ++entry}, id << 16U | heartbeat_time_ms});
  }
}

/// The same for network variables.
std::string own_variables(const PlantDevice& plan) {
  std::string text;
  for (const auto& each : plan.does.variables) {
    text += fmt::format("\n{} {} {}", each.name, od::name(each.type), od::write_object(each.object));
  }
  return text;
}

/// Adds the variables to the description. Null: a finding names those that have no place there.
std::shared_ptr<const od::Description> with_variables(const PlantDevice& plan, const eds::File& file,
                                                      const od::Description& description, Findings& findings) {
  std::vector<process::VariableProblem> problems;
  auto made = process::with_variables(description, file.dynamic_segments, plan.does.variables, problems);
  for (auto& each : problems) {
    findings.push_back({Finding::Severity::error, plan.name, 0, 0, fmt::format("variables.{}", each.name),
                        std::move(each.message), std::move(each.fix)});
  }
  return made;
}

struct LoadedProgram {
  device::ProgramHead head;
  std::vector<std::uint8_t> content;
};

std::optional<LoadedProgram> loaded_program(const PlantDevice& plan, Findings& findings) {
  const auto& p = plan.storing.programs;
  if (p.loaded.empty()) return std::nullopt;
  const auto& path = p.loaded_path.empty() ? p.loaded : p.loaded_path;
  const auto text = text::read_file(path, findings);
  if (!text) return std::nullopt;
  LoadedProgram program;
  program.content.assign(text->begin(), text->end());
  const auto head = device::read_program_head(program.content);
  if (head) {
    program.head = *head;
    program.content.erase(program.content.begin(), program.content.begin() + device::ProgramHead::size);
  }
  const bool whole = !program.content.empty() && program.content.size() <= p.size &&
                     (head ? head->length == program.content.size() : !p.checked);
  if (whole) return program;
  findings.push_back({Finding::Severity::error,
                      path,
                      0,
                      0,
                      {},
                      fmt::format("it is not a program for device \"{}\"", plan.name),
                      "a program has its head (docs/programs.md) and fits `size`"});
  return std::nullopt;
}

/// Removes the next word from a line.
std::string_view word(std::string_view& line) noexcept {
  const auto end = std::min(line.find(' '), line.size());
  const auto taken = line.substr(0, end);
  line.remove_prefix(std::min(end + 1, line.size()));
  return taken;
}

std::optional<std::uint32_t> number(std::string_view text) noexcept {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || text.empty()) return std::nullopt;
  return value;
}

std::optional<Kept> parse_kept(std::string_view line) {
  Kept k;
  const auto serial = number(word(line));
  const auto id = number(word(line));
  const auto rate = number(word(line));
  const auto plugged = number(word(line));
  auto bytes = word(line);
  const auto end = std::min(bytes.find('+'), bytes.size());
  const auto image = unhex(bytes.substr(0, end));
  bytes.remove_prefix(std::min(end + 1, bytes.size()));
  const auto list_memory = unhex(bytes);
  if (!serial || !id || !rate || !plugged || !image || !list_memory || line.empty()) return std::nullopt;
  const auto node_id = NodeId::make(*id);
  if (!node_id || *plugged > 1) return std::nullopt;
  k = {*serial, *node_id, *rate, *plugged == 1, *image, *list_memory, std::string(line)};
  return k;
}

/// Names what a device has that its description lacks; empty if nothing.
void warn_of_supplied(Findings& findings, const std::string& file, std::span<const ObjectRef> supplied) {
  if (supplied.empty()) return;
  std::string names;
  for (const ObjectRef& each : supplied) {
    names += names.empty() ? "" : ", ";
    names += each.sub == 0 ? fmt::format("{:04X}h", each.index) : od::write_object(each);
  }
  findings.push_back(
      {Finding::Severity::warning,
       file,
       0,
       0,
       {},
       fmt::format("not described, and mandatory in every device (CiA 301): {}. The device made from it has {}", names,
                   supplied.size() == 1 ? "it" : "them"),
       {}});
}

}  // namespace

// An NMT master keeps the configurations of its slaves (1F22h), which are DOMAINs.
device::GroupOf parameter_group_of(const PlantDevice& plan) noexcept {
  if (!plan.does.master || plan.does.master->flying) return device::default_parameter_group;
  return [](const od::Description& description, const od::Object& object, const od::SubObject& sub) noexcept {
    const bool configuration = object.index == 0x1F22 && sub.sub != 0;
    return configuration ? device::parameter_group::communication
                         : device::default_parameter_group(description, object, sub);
  };
}

std::size_t memory_of(const PlantDevice& plan, const od::Description& description) noexcept {
  constexpr std::size_t of_a_master = 2 * 65'536;  // the old image and the new one
  const std::size_t all = device::memory_size(description, parameter_group_of(plan));
  return plan.does.master ? std::min(all, device::parameters_at + of_a_master) : all;
}

device::Timing timing_of(const PlantDevice& plan) {
  device::Timing t;
  t.response_min = plan.response.min;
  t.response_max = plan.response.max;
  t.outlier_per_million = plan.response.outlier_ppm;
  t.outlier = plan.response.outlier;
  t.rx_depth = static_cast<std::uint16_t>(std::clamp<std::uint32_t>(plan.controller.rx_depth, 1, 1024));
  t.boot = plan.boot;
  t.reset = plan.reset;
  t.deaf_while_storing = plan.storing.deaf;
  t.power_cycle_after_store = plan.storing.power_cycle_after;
  t.needs_first_save = plan.storing.needs_first_save;
  t.heartbeat_sent = plan.does.odd.heartbeat_sent;
  t.drift_ppm = plan.controller.drift_ppm;
  return t;
}

device::Options options_of(const PlantDevice& plan, const LssAddress& address, std::uint32_t bit_rate,
                           std::uint64_t seed) {
  device::Options o;
  o.address = address;
  o.source = remembers(plan.source) ? device::NodeIdSource::nonvolatile : device::NodeIdSource::fixed;
  o.node_id = plan.source == NodeIdSource::blank ? NodeId() : plan.node_id;
  o.bit_rate = bit_rate;
  o.lss.on = plan.speaks.has(Speaks::lss);
  o.lss.fastscan = plan.speaks.has(Speaks::fastscan);
  if (plan.speaks.has(Speaks::feedback_29)) o.lss.feedback = lss::Feedback::extended;
  if (plan.speaks.has(Speaks::feedback_11)) o.lss.feedback = lss::Feedback::base;
  if (plan.lss.habit == Habit::canopennode) o.lss.habit = device::LssHabit::canopennode;
  if (plan.lss.habit == Habit::lely) o.lss.habit = device::LssHabit::lely;
  o.lss.habit_seed = seed;
  o.lss.without = plan.lss.without;
  o.lss.stores = !plan.lss.refuses_store;
  o.lss.short_answers = plan.lss.short_answers;
  if (!plan.speaks.has(Speaks::rand)) {
    o.rand = device::RandMode::off;
  } else {
    o.rand = plan.speaks.has(Speaks::rand_literal) ? device::RandMode::literal : device::RandMode::on;
  }
  o.rand_resume = plan.speaks.has(Speaks::rand_resume);
  o.and_protocol = plan.speaks.has(Speaks::and_protocol);
  o.claim = plan.speaks.has(Speaks::claim);
  if (plan.speaks.has(Speaks::negotiation)) {
    const bool literal = plan.speaks.has(Speaks::negotiation_literal);
    o.negotiation = literal ? device::NegotiationMode::literal : device::NegotiationMode::on;
  }
  o.negotiator.seed = seed;
  if (plan.source == NodeIdSource::blank) o.negotiator.configured = plan.node_id;  // only studies set one, no file
  if (plan.node_id_object.object) {
    o.node_id_object = device::NodeIdAsObject{*plan.node_id_object.object};
    if (const auto& s = plan.node_id_object.signature) {
      o.node_id_object->signature = device::Signature{s->object, s->value};
    }
  }
  o.bus_off_recovery = bus_off_recovery;
  if (plan.eds.empty()) o.name = plan.name;
  if (const auto heartbeat = co::whole_ms(plan.heartbeat); heartbeat > 0) o.presets.push_back({{0x1017, 0}, heartbeat});
  o.parameter_group = parameter_group_of(plan);
  // A master that leaves operational because one slave is lost (1029h:01) would leave all others alone.
  if (plan.does.master && !plan.does.master->flying) o.presets.push_back({{0x1029, 1}, 1});
  if (plan.does.master && plan.does.master->flying) preset_network_list(*plan.does.master, o);
  return o;
}

device::ProgramOptions programs_of(const PlantDevice& plan, device::SimFlash* flash) {
  const auto& p = plan.storing.programs;
  device::ProgramOptions options;
  options.memory = flash;
  options.layout = {.count = static_cast<std::uint8_t>(std::max<std::uint32_t>(p.count, 1)),
                    .images = p.images,
                    .longest = p.size,
                    .sector = p.sector};
  options.checked = p.checked;
  return options;
}

std::unique_ptr<device::SimFlash> program_flash_of(const PlantDevice& plan, rt::Executor& executor) {
  const auto& p = plan.storing.programs;
  if (p.count == 0) return nullptr;
  const auto size = device::ProgramMemory::footprint(programs_of(plan, nullptr).layout);
  auto flash = std::make_unique<device::SimFlash>(executor, size, rt::Duration(0));
  flash->set_times({.byte = p.write, .sector = p.erase, .sector_size = p.sector});
  Findings unread;
  const auto image = loaded_program(plan, unread);
  if (image) flash->restore(device::ProgramMemory::holding(image->head, image->content));
  return flash;
}

bool check_programs(const PlantDevice& plan, const od::Description& description, Findings& findings) {
  if (plan.storing.programs.count == 0) return true;
  const ObjectRef last{od::cia302::program_data, static_cast<std::uint8_t>(plan.storing.programs.count)};
  const bool has = description.find(last) != nullptr &&
                   description.find(ObjectRef{od::cia302::program_control, last.sub}) != nullptr;
  if (!has) {
    findings.push_back({Finding::Severity::error,
                        plan.eds_path.empty() ? plan.eds : plan.eds_path,
                        0,
                        0,
                        {},
                        fmt::format("it has no 1F50h:{:02X} and 1F51h:{:02X}, and device \"{}\" has programs", last.sub,
                                    last.sub, plan.name),
                        "describe 1F50h to 1F57h, or take `programs` away"});
  }
  return has && (plan.storing.programs.loaded.empty() || loaded_program(plan, findings).has_value());
}

void SimListMemory::read(std::size_t at, std::span<std::uint8_t> into) const noexcept {
  std::ranges::fill(into, std::uint8_t{0xFF});
  if (at >= bytes_.size()) return;
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), std::min(into.size(), bytes_.size() - at),
              into.begin());
}

bool SimListMemory::write(std::size_t at, std::span<const std::uint8_t> bytes) noexcept {
  if (at > size() || bytes.size() > size() - at) return false;
  if (bytes_.size() < at + bytes.size()) bytes_.resize(at + bytes.size(), 0xFF);
  const bool cuts = cut_ && left_ < bytes.size();
  const auto whole = bytes.first(cuts ? left_ : bytes.size());
  std::ranges::copy(whole, bytes_.begin() + static_cast<std::ptrdiff_t>(at));
  if (cuts && torn_ >= 0) bytes_[at + left_] = static_cast<std::uint8_t>(torn_);
  if (cuts) {
    const auto cut = std::exchange(cut_, nullptr);
    cut();
    return false;
  }
  left_ -= std::min<std::uint64_t>(left_, bytes.size());
  if (on_write_) on_write_();
  return true;
}

void SimListMemory::cut_after(std::uint64_t bytes, std::function<void()> cut, int torn) {
  left_ = bytes;
  cut_ = std::move(cut);
  torn_ = torn;
}

PlantMastery master_of(const PlantDevice& plan, can::Dispatcher& dispatcher, device::Device& device) {
  PlantMastery made;
  if (!plan.does.master) return made;
  network::NetworkTiming timing;
  timing.resumes = !plan.does.master->flying;
  const auto apply = [&device](co::NmtCommand command) { device.apply(command); };
  made.manager = std::make_unique<network::DictionaryManager>(dispatcher, device.values(), apply, timing);
  if (!plan.does.master->flying) {
    auto& bus = made.manager->bus();
    made.memory = std::make_unique<SimListMemory>();
    made.store = std::make_unique<manager::ListStore>(made.memory.get());
    made.assigner = std::make_unique<manager::NodeIdAssigner>(
        manager::ListServices{dispatcher, bus.sdo(), bus.nmt(), device.values(), *made.store});
    made.manager->assign_by(made.assigner.get());
  }
  auto* const manager = made.manager.get();
  device.on().state = [manager, &device](NmtState state) { manager->own_state(state, device.node_id()); };
  return made;
}

std::vector<std::uint8_t> list_memory_of(const PlantMastery& mastery) {
  if (!mastery.memory) return {};
  const auto image = mastery.memory->image();
  return {image.begin(), image.end()};
}

const Described* Descriptions::of(const PlantDevice& device, Findings& findings, GatewayPart part) {
  const auto& file = device.eds_path.empty() ? device.eds : device.eds_path;
  const auto path = !file.empty()     ? file
                    : part.ports != 0 ? fmt::format("gateway of {}, {} signals, hardware {}", part.ports, part.signals,
                                                    device.does.hardware)
                    : part.signals != 0 ? fmt::format("{} of a gateway, {} signals", own_objects(device), part.signals)
                                        : own_objects(device);
  auto& described = known_[path + own_variables(device)];
  if (described.description) return &described;
  if (described.unreadable) return nullptr;
  if (device.does.master) {
    described.description = with_manager(device.does, part.signals);
    return &described;
  }
  if (file.empty()) {
    described.description = path.empty()      ? device::minimal_description()
                            : part.ports != 0 ? gateway_description(part.ports, part.signals, device.does.hardware)
                                              : with_own_objects(device, part.signals);
    return &described;
  }
  const auto reading = eds::read_any_file(path);
  std::ranges::copy_if(reading.findings, std::back_inserter(findings),
                       [](const Finding& f) { return f.severity == Finding::Severity::error; });
  if (!reading.usable()) {
    described.unreadable = true;
    return nullptr;
  }
  const auto absent = device::mandatory_absent(*reading.file.description);
  warn_of_supplied(findings, path, absent);
  described.description = absent.empty() ? reading.file.description : device::with_mandatory(*reading.file.description);
  if (!device.does.variables.empty()) {
    described.description = with_variables(device, reading.file, *described.description, findings);
    described.unreadable = described.description == nullptr;
    if (described.unreadable) return nullptr;
  }
  described.type = reading.file.type_code();
  described.revision = reading.file.revision();
  return &described;
}

std::optional<script::Script> Scripts::of(const PlantDevice& device, Findings& findings) {
  const auto& written = device.does.script;
  if (written.file.empty()) return std::nullopt;
  const auto& path = written.path.empty() ? written.file : written.path;
  const auto [known, fresh] = known_.try_emplace(path);
  if (!fresh) return known->second;
  auto text = text::read_file(path, findings);
  if (!text) return std::nullopt;
  script::Script script{path, *std::move(text)};
  if (auto wrong = script::check(script)) {
    findings.push_back(*std::move(wrong));
  } else {
    known->second = std::move(script);
  }
  return known->second;
}

LssAddress address_of(const PlantDevice& device, const Described& described) noexcept {
  auto address = device.address;
  if (!device.address_of_eds) return address;
  address.vendor = described.type.vendor;
  address.product = described.type.product;
  address.revision = described.revision;
  return address;
}

std::string write_state(std::span<const Kept> devices) {
  std::string text = fmt::format("{}\n", state_header);
  for (const auto& k : devices) {
    text += fmt::format("{} {} {} {} {}{}{} {}\n", k.serial, k.node_id.value(), k.bit_rate, k.plugged ? 1 : 0,
                        hex(k.image), k.list_memory.empty() ? "" : "+", hex(k.list_memory), k.name);
  }
  return text;
}

Result<std::vector<Kept>> parse_state(std::string_view text) {
  std::vector<Kept> kept;
  bool header = false;
  while (!text.empty()) {
    const auto end = std::min(text.find('\n'), text.size());
    const auto line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!std::exchange(header, true)) {
      if (line != state_header) return fail(Errc::invalid, "not the state of a plant");
      continue;
    }
    auto one = parse_kept(line);
    if (!one) return fail(Errc::invalid, "the state of a plant is damaged");
    kept.push_back(*std::move(one));
  }
  if (!header) return fail(Errc::invalid, "not the state of a plant");
  return kept;
}

bool write_state_file(const std::string& path, std::string_view text) {
  PartFile part(path);
  return part.write(text) == 0 && part.replace() == 0;
}

Result<std::optional<std::string>> read_state_file(const std::string& path) {
  std::optional<std::string> state;
  std::error_code unknown;
  if (std::filesystem::exists(path, unknown)) {
    Findings findings;
    auto text = text::read_file(path, findings);
    if (!text) return fail(Errc::io, "cannot be read; is it a file?");
    state = std::move(text);
  }
  // Refuses now instead of losing the state at the end. The file is not touched before there is something to keep.
  const auto folder = std::filesystem::absolute(path, unknown).parent_path();
  if (::access(folder.c_str(), W_OK) != 0) return fail(Errc::io, "its folder is not there or cannot be written");
  return state;
}

}  // namespace berth::plant

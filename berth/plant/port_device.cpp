#include "berth/plant/port_device.hpp"

#include <algorithm>
#include <utility>

namespace berth::plant {

PortDevice::PortDevice(PortDevices& all, rt::Executor& executor, const PlantDevice& plan, Parts parts, Random random)
    : all_(&all),
      plan_(plan),
      timing_(timing_of(plan)),
      flash_(executor, memory_of(plan, *parts.described->description), timing_.in_world(plan.storing.time)),
      program_flash_(program_flash_of(plan, executor)),
      port_(std::move(parts.port)),
      host_(executor, *port_, timing_, random),
      meter_(parts.metered ? std::make_optional<multilevel::MeteredPort>(executor, host_) : std::nullopt),
      dispatcher_(executor, meter_ ? static_cast<can::Port&>(*meter_) : host_),
      device_(dispatcher_, parts.described->description, &flash_,
              options_of(plan, address_of(plan, *parts.described), plan.bitrate != 0 ? plan.bitrate : parts.rate,
                         Random(random).next()),
              &host_, timing_, programs_of(plan, program_flash_.get())),
      odd_(plan.does.odd, device_, executor) {
  flash_.watch(this);
  device_.observe(this);
  if (parts.script) {
    script::Behaviour::Listener& listener = *this;
    behaviour_ =
        std::make_unique<script::Behaviour>(device_, executor, *std::move(parts.script), random.fork(), listener);
  }
  master_ = master_of(plan_, dispatcher_, device_);
  if (master_.memory) master_.memory->on_write([this] { all_->save(); });
}

PortDevice::~PortDevice() {
  flash_.watch(nullptr);
  device_.observe(nullptr);
}

void PortDevice::power(bool on) noexcept {
  if (std::exchange(powered_, on) == on) return;
  if (!on) {
    if (master_.manager) master_.manager->power_off();
    device_.power_off();
    if (behaviour_) behaviour_->stop();
    return all_->tell(*this);
  }
  if (begin_wait()) return all_->tell(*this);  // a gateway boots after the buses beneath it
  device_.power_on();
}

void PortDevice::device_changed(const device::Device&) noexcept { all_->tell(*this); }

void PortDevice::write_ended() noexcept { all_->save(); }

void PortDevice::script_told(const script::Message& told) noexcept {
  if (all_->observer_ != nullptr) all_->observer_->script_told(*this, told);
}

bool PortDevice::script_must_end() noexcept {
  return all_->observer_ != nullptr && all_->observer_->scripts_must_end();
}

// --- PortDevices -----------------------------------------------------------------------------------------------------

PortDevice* PortDevices::add(const PlantDevice& plan, std::unique_ptr<can::Port> port, std::uint32_t rate,
                             Random random, Findings& findings, GatewayPart part) {
  const auto* const described = descriptions_.of(plan, findings, part);
  auto script = scripts_.of(plan, findings);
  if (!script && !plan.does.script.file.empty()) return nullptr;
  if (described == nullptr || !check_programs(plan, *described->description, findings)) return nullptr;
  PortDevice::Parts parts{described, std::move(script), std::move(port), rate, part.any};
  devices_.push_back(std::make_unique<PortDevice>(*this, *executor_, plan, std::move(parts), random));
  return devices_.back().get();
}

PortDevice* PortDevices::find(std::string_view name) noexcept {
  const auto it = std::ranges::find(devices_, name, [](const auto& d) { return std::string_view(d->name()); });
  return it == devices_.end() ? nullptr : it->get();
}

bool PortDevices::add_gateway(const PlantGateway& plan, const PlantFile& plant, Findings& findings) {
  PortDevice* const above = find(plan.above);
  if (above == nullptr) return false;
  std::vector<GatewaySide*> beneath;
  for (const auto& name : plan.beneath) {
    PortDevice* const port = find(name);
    if (port == nullptr) return false;
    beneath.push_back(port);
  }
  if (!check_gateway(plan, above->device(), findings)) return false;
  gateways_.push_back(std::make_unique<SimGateway>(*executor_, *above, std::move(beneath), plan, plant));
  return true;
}

std::string PortDevices::state() const {
  auto kept = others_;
  for (const auto& d : devices_) {
    const auto& o = d->device_.options();
    const auto image = d->flash_.image();
    kept.push_back({o.address.serial,
                    o.node_id,
                    o.bit_rate,
                    true,
                    {image.begin(), image.end()},
                    list_memory_of(d->master_),
                    d->name()});
  }
  return write_state(kept);
}

Result<void> PortDevices::restore(std::string_view state) {
  auto kept = parse_state(state);
  if (!kept) return tl::unexpected(kept.error());
  others_.clear();
  for (auto& one : *kept) {
    const auto it =
        std::ranges::find(devices_, one.name, [](const auto& d) -> const std::string& { return d->name(); });
    if (it == devices_.end()) {
      others_.push_back(std::move(one));
      continue;
    }
    auto& device = **it;
    auto address = device.device_.options().address;
    address.serial = one.serial;
    device.device_.set_address(address);
    device.device_.set_blank(one.node_id, one.bit_rate);
    device.flash_.restore(one.image);
    if (device.master_.memory) device.master_.memory->restore(one.list_memory);
  }
  return {};
}

Result<void> PortDevices::keep_state(const std::string& path) {
  const auto text = read_state_file(path);
  if (!text) return tl::unexpected(text.error());
  if (text->has_value()) {
    if (auto restored = restore(**text); !restored) return restored;
  }
  state_path_ = path;
  return {};
}

void PortDevices::tell(const PortDevice& device) noexcept {
  for (auto& gateway : gateways_) gateway->changed(device.device_);
  if (observer_ != nullptr) observer_->device_changed(device);
}

void PortDevices::save() noexcept {
  if (state_path_.empty() || write_state_file(state_path_, state())) return;
  if (observer_ != nullptr) observer_->state_not_kept();
}

}  // namespace berth::plant

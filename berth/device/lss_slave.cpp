#include "berth/device/lss_slave.hpp"

#include <array>
#include <utility>

#include "berth/co/cob_id.hpp"

namespace berth::device {
namespace {

constexpr std::size_t record_size = 4;  // node-ID, bit rate index, two bytes in reserve
static_assert(NvRecord::footprint(record_size) <= LssSlave::memory_size);

lss::BitRateMask bit_rates(const Options& options) noexcept {
  return lss::bit_rate_index(options.bit_rate) ? lss::all_fixed_bit_rates : lss::BitRateMask{0};
}

// The settings in `record`; if the memory is blank, those of the options.
lss::Settings load(const Options& options, std::optional<NvRecord>& record) noexcept {
  lss::Settings settings{options.node_id, lss::bit_rate_index(options.bit_rate).value_or(lss::BitRateIndex::kbit_125)};
  std::array<std::uint8_t, record_size> raw{};
  if (!record || record->busy() || !record->load(raw)) return settings;
  const auto id = NodeId::make(raw[0]);
  if (id && options.source == NodeIdSource::nonvolatile) settings.node_id = *id;
  if (lss::contains(bit_rates(options), raw[1])) settings.bit_rate = static_cast<lss::BitRateIndex>(raw[1]);
  return settings;
}

bool is_lacking(const LssOptions& how, lss::Command request) noexcept {
  const auto service = lss::lackable(request);
  return service && how.without.has(*service);
}

lss::Answers as_sent(const LssOptions& how, const lss::Answers& answers) noexcept {
  if (!how.short_answers || !answers) return answers;
  const can::Frame answer = lss::short_answer(*answers);
  if (answers.feedback()) return {*answers.feedback(), answer};
  return std::optional(answer);
}

}  // namespace

LssSlave::LssSlave(can::Dispatcher& dispatcher, const Options& options, NvMemory* memory, Host& host, Owner& owner)
    : dispatcher_(&dispatcher), options_(&options), host_(&host), owner_(&owner) {
  if (memory != nullptr) record_.emplace(*memory, 0, record_size);
  stored_ = load(*options_, record_);
  slave_.emplace(dispatcher.executor(), static_cast<lss::SlaveOwner&>(*this),
                 lss::SlaveOptions{.address = options.address}, stored_);
  if (!options.lss.on) return;
  const bool habit = options.lss.habit != LssHabit::none;
  if (habit || options.lss.feedback != lss::Feedback::none) answers_ = std::make_unique<lss::AnswerQueue>(dispatcher);
  if (habit) {
    habits_ = std::make_unique<LssHabits>(options.lss.habit, dispatcher.executor(), *answers_, options.lss.habit_seed);
  }
}

LssSlave::~LssSlave() {
  if (storing()) record_->forget();  // it would call an object that no longer exists
}

// --- Power and resets ------------------------------------------------------------------------------------------------

void LssSlave::power_on() noexcept {
  powered_ = true;
  stored_ = load(*options_, record_);
  const auto& how = options_->lss;
  const lss::SlaveOptions options{.address = options_->address,
                                  .bit_rates = bit_rates(*options_),
                                  .can_store = record_.has_value() && how.stores,
                                  .change_at_waiting = how.changes_at_waiting,
                                  .fastscan = how.fastscan,
                                  .feedback = how.feedback,
                                  .feedback_base = how.feedback_base};
  slave_.emplace(dispatcher_->executor(), static_cast<lss::SlaveOwner&>(*this), options, stored_);
  if (habits_) habits_->reset();
}

void LssSlave::power_off() noexcept {
  powered_ = false;
  waits_ = nullptr;
  resetting();
  if (record_) record_->forget();  // stops the memory, whoever writes
  stored_ = load(*options_, record_);
  slave_->power_on(stored_);
}

void LssSlave::resetting() noexcept {
  dispatcher_->remove(*this);
  if (answers_) answers_->drop();
  if (habits_) habits_->reset();
}

void LssSlave::reset(Reset what) noexcept {
  const bool keeps = host_->timing().power_cycle_after_store && what != Reset::power_on;
  if (what != Reset::communication) {
    const auto settings = keeps ? slave_->active() : stored_;
    slave_->power_on(settings);
  } else if (!keeps) {
    slave_->reset_communication();
  }
  const auto now = dispatcher_->port().status().bit_rate;
  const auto rate = lss::bit_rate(slave_->active().bit_rate).value_or(0);
  if (bit_rates(*options_) != 0 && now != 0 && rate != 0 && rate != now) dispatcher_->port().restart(rate);
}

void LssSlave::listen(bool initialising) {
  dispatcher_->remove(*this);
  if (options_->lss.on) dispatcher_->add(can::only(lss::master_cob_id), *this);
  if (habits_ && habits_->boots_by_nmt() && initialising) dispatcher_->add(can::only(co::nmt_command_id), *this);
}

void LssSlave::assign(NodeId id) noexcept {
  slave_->set_pending(id);
  slave_->reset_communication();
}

bool LssSlave::keep(NodeId id, NvMemory::Done& done) noexcept {
  lss::Settings settings = slave_->pending();
  settings.node_id = id;
  if (store(settings)) return false;  // a result at once is a refusal
  slave_->set_pending(id);
  waits_ = &done;
  return true;
}

// --- Requests --------------------------------------------------------------------------------------------------------

void LssSlave::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.key() == co::nmt_command_id) return boot_by_nmt(frame);
  const bool lacks = lss::is_lss(frame, lss::master_cob_id) && is_lacking(options_->lss, lss::command(frame));
  const auto answers = lacks ? lss::Answers() : as_sent(options_->lss, answer(frame));
  owner_->lss_heard(answers.has_value());
  if (answers_) {
    answers_->send(answers);
  } else if (answers) {
    dispatcher_->send(*answers);
  }
}

// For a stack that uses 255 as its node-ID until it has another.
void LssSlave::boot_by_nmt(const can::Frame& frame) noexcept {
  const bool reset = frame.size == 2 && (frame.data[0] == 0x81 || frame.data[0] == 0x82);
  const bool mine = frame.data[1] == 0 || frame.data[1] == NodeId::unconfigured_value;
  if (reset && mine) owner_->reset_by_lss(static_cast<co::NmtCommand>(frame.data[0]));
}

lss::Answers LssSlave::answer(const can::Frame& frame) noexcept {
  if (slave_->silent()) return {};
  const bool configures_id =
      lss::is_lss(frame, lss::master_cob_id) && lss::command(frame) == lss::Command::configure_node_id;
  const bool refuses = options_->source == NodeIdSource::fixed && slave_->state() == lss::State::configuration;
  if (configures_id && refuses) {
    return std::optional(lss::answer(lss::Command::configure_node_id, lss::error::out_of_range));
  }
  auto answer = habits_ ? habits_->handle(frame, *slave_) : slave_->handle(frame);
  if (configures_id) owner_->changed();
  return answer;
}

void LssSlave::wants_reset_communication() noexcept {
  if (habits_ && habits_->boots_by_nmt() && slave_->initialising()) return;
  if (!host_->timing().power_cycle_after_store) owner_->reset_by_lss(co::NmtCommand::reset_communication);
}

void LssSlave::switch_bit_rate(lss::BitRateIndex index) noexcept {
  if (const auto rate = lss::bit_rate(index); rate && *rate != 0) dispatcher_->port().restart(*rate);
  owner_->hush(true);
}

// --- Memory ----------------------------------------------------------------------------------------------------------

lss::Settings LssSlave::persistent() const noexcept {
  if (powered_) return stored_;
  auto record = record_;  // a copy: finding the valid slot must not change this one
  return load(*options_, record);
}

std::optional<lss::StoreResult> LssSlave::store(const lss::Settings& settings) noexcept {
  const std::array<std::uint8_t, record_size> raw{settings.node_id.value(),
                                                  static_cast<std::uint8_t>(settings.bit_rate), 0, 0};
  if (!record_ || !record_->save(raw, *this)) return lss::StoreResult{lss::error::storage, 0};
  being_stored_ = settings;
  host_->storing(true);
  return std::nullopt;
}

void LssSlave::written(bool ok) noexcept {
  host_->storing(false);
  if (auto* const waits = std::exchange(waits_, nullptr)) waits->written(ok);
  if (ok) {
    stored_ = being_stored_;
    if (options_->source == NodeIdSource::fixed) stored_.node_id = options_->node_id;
  }
  // No answer if a reset came in between: no master waits for it any more.
  const auto answer = as_sent(options_->lss, slave_->stored({ok ? lss::error::ok : lss::error::storage, 0}));
  if (answer) dispatcher_->send(*answer);
  owner_->changed();
}

}  // namespace berth::device

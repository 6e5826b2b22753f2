#include "berth/multilevel/sdo_session.hpp"

#include <algorithm>
#include <limits>

#include "berth/base/bytes.hpp"
#include "berth/co/sdo_block.hpp"

namespace berth::multilevel {
namespace {

using od::AbortCode;

// More than one sub-block is in transit between the two buses only while the slower bus takes the previous one.
constexpr std::size_t crowd = 2 * co::sdo::block_window;
// In a chain of gateways, each gets the data in sub-blocks from the one above it. While a gateway collects a long
// sub-block on a slow bus, the next server would wait for its next frame longer than its timeout, and then the client
// for the end of all that is still on its way.
constexpr std::size_t passed_sub_block = std::size_t{16} * co::sdo::segment_bytes;
constexpr std::size_t passed_crowd = 2 * passed_sub_block;

AbortCode code_of(const Error& error) noexcept {
  switch (error.code) {
    case Errc::aborted: return error.detail == 0 ? AbortCode::general : static_cast<AbortCode>(error.detail);
    case Errc::timeout: return AbortCode::timeout;
    case Errc::mismatch: return error.detail == 0 ? AbortCode::general : static_cast<AbortCode>(error.detail);
    case Errc::bus: return AbortCode::hardware;
    default: return AbortCode::general;
  }
}

co::SdoOptions options_of(const SdoGatewayOptions& gateway, const GatewayCommand& command) noexcept {
  co::SdoOptions options = gateway.sdo;
  options.mode = command.mode;
  options.retries = 0;  // the client above asks again
  if (SdoGatewayObjects::contain(command.object)) options.timeout *= 1 + gateway.levels_beneath;
  return options;
}

// Data for the gateway's own device are stored whole, and may be as long as its object.
std::size_t room_of(const SdoGatewayOptions& options, const od::Values* own, ObjectRef object) noexcept {
  const auto* const sub = own == nullptr ? nullptr : own->description().find(object);
  return std::max<std::size_t>(options.store, sub == nullptr ? 0 : sub->capacity);
}

}  // namespace

std::optional<GatewayCommand> parse_command(std::uint32_t value) noexcept {
  using Kind = GatewayCommand::Kind;
  const auto byte = static_cast<std::uint8_t>(value);
  GatewayCommand command{.object = {static_cast<std::uint16_t>(value >> 8U), static_cast<std::uint8_t>(value >> 24U)}};
  switch (static_cast<co::sdo::Ccs>(co::sdo::specifier(byte))) {
    case co::sdo::Ccs::download:
      if ((byte & 0x10U) != 0) return std::nullopt;
      if ((byte & 0x02U) == 0) {
        command.kind = (byte & 0x01U) != 0 ? Kind::download : Kind::passed_download;
        return (byte & 0x0CU) == 0 ? std::optional(command) : std::nullopt;
      }
      command.kind = Kind::expedited_download;
      if ((byte & 0x01U) != 0) command.length = 4U - ((byte >> 2U) & 0x03U);
      return command;
    case co::sdo::Ccs::upload: return byte == 0x40 ? std::optional(command) : std::nullopt;
    case co::sdo::Ccs::block_upload:
      command.mode = co::SdoMode::block;
      return (byte & 0x1BU) == 0 ? std::optional(command) : std::nullopt;
    case co::sdo::Ccs::block_download:
      command.kind = (byte & 0x02U) != 0 ? Kind::download : Kind::passed_download;
      command.mode = co::SdoMode::block;
      return (byte & 0x19U) == 0 ? std::optional(command) : std::nullopt;
    default: return std::nullopt;
  }
}

SdoSession::SdoSession(SdoGateway& gateway, std::uint8_t channel) noexcept
    : gateway_(&gateway),
      channel_(channel),
      wake_(*this, *gateway.executor_),
      client_left_(*this, *gateway.executor_),
      scope_(*gateway.executor_) {}

// ---- what the client above writes ----

AbortCode SdoSession::select(std::uint8_t node) noexcept {
  if (node < 1 || node > 127) return AbortCode::invalid_value;
  node_[0] = node;
  return AbortCode::none;
}

AbortCode SdoSession::command(std::uint32_t value) noexcept {
  const bool has_data = state_ == State::stored;
  if (!has_data) cancel();
  const auto parsed = parse_command(value);
  if (!parsed) return AbortCode::command_specifier;
  if (node_[0] == 0) return AbortCode::device_state;
  command_ = *parsed;
  store_le(command_bytes_.data(), value);
  switch (parsed->kind) {
    case GatewayCommand::Kind::upload:
      cancel();
      start(State::uploading);
      return AbortCode::none;
    case GatewayCommand::Kind::expedited_download:
      if (!has_data) return AbortCode::no_data;
      if (queue_.size() != parsed->length.value_or(queue_.size()) || queue_.size() > 4 || queue_.size() == 0) {
        cancel();
        return AbortCode::length_mismatch;
      }
      return begin_sending();
    case GatewayCommand::Kind::download: return has_data ? begin_sending() : AbortCode::no_data;
    default:
      cancel();
      state_ = State::armed;
      return AbortCode::none;
  }
}

AbortCode SdoSession::begin_sending() noexcept {
  if (od::Values* const own = gateway_->own(node())) {
    const auto code = own->write(command_.object, queue_.bytes());
    const bool armed = state_ == State::armed;
    cancel();
    if (code != AbortCode::pending) return code;
    if (armed) return AbortCode::none;  // its data came after its command: there is no second answer to delay
    state_ = State::sending;
    finished_ = false;
    saves_ = true;
    client_left_.arm(gateway_->options_.save_timeout);
    return code;
  }
  size_ = queue_.size();
  all_in_ = true;
  start(State::sending);
  return AbortCode::pending;
}

void SdoSession::start(State state) noexcept {
  state_ = state;
  begun_ = finished_ = crowded_ = waits_ = false;
  failure_ = AbortCode::none;
  if (state == State::uploading) {
    scope_.spawn(upload());
  } else if (state == State::passing) {
    scope_.spawn(pass());
  } else {
    scope_.spawn(send());
  }
}

void SdoSession::completed(ObjectRef object, AbortCode code) noexcept {
  if (!std::exchange(saves_, saves_ && object != command_.object)) return;
  client_left_.cancel();
  finished_ = true;
  failure_ = code;
  wake_.post();
}

void SdoSession::cancel() noexcept {
  saves_ = false;
  scope_.cancel();
  wake_.cancel();
  client_left_.cancel();
  queue_.clear();
  size_.reset();
  all_in_ = false;
  waits_ = false;
  state_ = State::idle;
}

void SdoSession::reset() noexcept {
  cancel();
  node_ = {};
  command_bytes_ = {};
}

// ---- the access beneath ----

rt::Task<void> SdoSession::upload() {
  const NodeId node = this->node();
  if (od::Values* const own = gateway_->own(node)) {
    std::vector<std::uint8_t> bytes(own->size(command_.object).value_or(gateway_->options_.store));
    const auto count = own->read(command_.object, bytes);
    if (count) {
      sink_.begin(*count);
      if (*count > 0) static_cast<void>(sink_.write(std::span(bytes).first(*count)));
    } else {
      failure_ = count.error();
    }
    finished_ = true;
    wake_.post();
    co_return;
  }
  const co::SdoOptions options = options_of(gateway_->options_, command_);
  co::SdoSink& sink = sink_;
  const auto done =
      co_await gateway_->beneath_->upload(node, command_.object.index, command_.object.sub, sink, options);
  ended(done);
}

rt::Task<void> SdoSession::pass() {
  const NodeId node = this->node();
  const co::SdoOptions options = options_of(gateway_->options_, command_);
  co::SdoSource& source = source_;
  const auto done =
      co_await gateway_->beneath_->download(node, command_.object.index, command_.object.sub, source, options);
  ended(done);
}

rt::Task<void> SdoSession::send() {
  const NodeId node = this->node();
  const co::SdoOptions options = options_of(gateway_->options_, command_);
  const std::span<const std::uint8_t> data = queue_.bytes();
  const auto done =
      co_await gateway_->beneath_->download(node, command_.object.index, command_.object.sub, data, options);
  ended(done);
}

void SdoSession::ended(const Result<void>& done) noexcept {
  finished_ = true;
  failure_ = done ? AbortCode::none : code_of(done.error());
  wake_.post();
}

AbortCode SdoSession::Sink::begin(std::optional<std::size_t> size) noexcept {
  session_->begun_ = true;
  session_->size_ = size;
  session_->wake_.post();
  return AbortCode::none;
}

AbortCode SdoSession::Sink::write(std::span<const std::uint8_t> bytes) noexcept {
  session_->queue_.put(bytes);
  session_->wake_.post();
  if (session_->queue_.size() <= crowd) return AbortCode::none;
  session_->client_left_.arm(session_->gateway_->options_.client_timeout);
  return AbortCode::pending;
}

std::size_t SdoSession::Source::ready() const noexcept {
  return session_->all_in_ ? std::numeric_limits<std::size_t>::max() : session_->queue_.size();
}

od::Answer<std::size_t> SdoSession::Source::read(std::span<std::uint8_t> into) noexcept {
  const auto count = session_->queue_.take(into);
  if (session_->crowded_ && session_->queue_.size() <= passed_crowd) session_->wake_.post();
  return count;
}

// ---- answers to the client above ----

void SdoSession::wake() noexcept {
  auto& channels = gateway_->upper_->channels();
  const auto& objects = gateway_->objects_;
  if (state_ == State::sending) {
    if (!finished_) return;
    const AbortCode code = failure_;
    const ObjectRef name = gateway_->options_.literal ? command_.object : objects.command;
    cancel();
    channels.answer(channel_, objects.command, code, name);
  } else if (state_ == State::uploading) {
    channels.answer(channel_, objects.data, AbortCode::none);
  } else if (state_ == State::passing) {
    if (finished_) {
      const AbortCode code = failure_;
      if (all_in_) cancel();
      channels.answer(channel_, objects.data, code);
    } else if (crowded_ && queue_.size() <= passed_crowd) {
      crowded_ = false;
      channels.answer(channel_, objects.data, AbortCode::none);
    }
  }
}

void SdoSession::client_left() noexcept {
  scope_.cancel();
  finished_ = true;
  failure_ = AbortCode::timeout;
  if (std::exchange(saves_, false)) wake_.post();
}

// ---- the client above reads the data ----

od::Answer<std::optional<std::size_t>> SdoSession::open_read(ObjectRef) noexcept {
  if (state_ != State::uploading) return od::refuse(AbortCode::no_data);
  if (finished_ && failure_ != AbortCode::none) return od::refuse(failure_);
  if (!begun_) return od::refuse(AbortCode::pending);
  if (!queue_.again()) return od::refuse(AbortCode::no_data);  // it was read before, and is no longer kept
  const bool expedited = size_ && *size_ >= 1 && *size_ <= 4;
  if (expedited && queue_.size() < *size_) return od::refuse(AbortCode::pending);
  return size_;
}

std::size_t SdoSession::ready() const noexcept {
  return finished_ ? std::numeric_limits<std::size_t>::max() : queue_.size();
}

od::Answer<std::size_t> SdoSession::read(std::span<std::uint8_t> into) noexcept {
  const auto count = queue_.take(into);
  if (count < into.size() && failure_ != AbortCode::none) return od::refuse(failure_);
  if (queue_.size() > crowd) {
    client_left_.arm(gateway_->options_.client_timeout);
    return count;
  }
  client_left_.cancel();
  sink_.go_on();
  return count;
}

ObjectRef SdoSession::named(ObjectRef ref) const noexcept {
  return gateway_->options_.literal && state_ == State::uploading ? command_.object : ref;
}

// ---- the client above writes the data ----

AbortCode SdoSession::open_write(ObjectRef, std::optional<std::size_t> size) noexcept {
  if (state_ != State::armed || gateway_->own(node()) != nullptr) {
    const bool armed = state_ == State::armed;
    if (!armed) cancel();
    const od::Values* const own = armed ? gateway_->own(node()) : nullptr;
    if (size.value_or(0) > room_of(gateway_->options_, own, command_.object)) return AbortCode::out_of_memory;
    if (!armed) state_ = State::storing;
    return AbortCode::none;
  }
  size_ = size;
  state_ = State::passing;
  waits_ = true;
  finished_ = crowded_ = false;
  failure_ = AbortCode::none;
  return AbortCode::none;
}

std::size_t SdoSession::sub_block() const noexcept { return passed_sub_block; }

AbortCode SdoSession::write(std::span<const std::uint8_t> bytes) noexcept {
  if (state_ != State::passing) {
    const od::Values* const own = state_ == State::armed ? gateway_->own(node()) : nullptr;
    const auto room = room_of(gateway_->options_, own, command_.object);
    if (queue_.size() + bytes.size() > room) return AbortCode::out_of_memory;
    queue_.put(bytes);
    return AbortCode::none;
  }
  if (finished_) return failure_ == AbortCode::none ? AbortCode::general : failure_;
  queue_.put(bytes);
  if (waits_) start(State::passing);  // only with the first bytes, so that the server beneath need not wait for them
  source_.go_on();
  if (queue_.size() <= passed_crowd) return AbortCode::none;
  crowded_ = true;
  return AbortCode::pending;
}

AbortCode SdoSession::close(ObjectRef, bool complete) noexcept {
  if (state_ == State::uploading && complete) return AbortCode::none;  // may be read once more
  if (!complete) {
    cancel();
    return AbortCode::none;
  }
  if (state_ == State::armed) return begin_sending();  // to the gateway's own device
  if (state_ != State::passing) {
    state_ = State::stored;
    return AbortCode::none;
  }
  if (waits_) start(State::passing);
  all_in_ = true;
  crowded_ = false;  // only the end is awaited from now on
  source_.go_on();
  if (!finished_) return AbortCode::pending;
  const AbortCode code = failure_;
  cancel();
  return code;
}

}  // namespace berth::multilevel

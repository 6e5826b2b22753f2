// An SDO server's channel on a port.
#include <algorithm>

#include "berth/co/sdo_server.hpp"

#include "berth/co/retry_parts.hpp"

namespace berth::co {

SdoServerService::SdoServerService(can::Dispatcher& dispatcher, od::Values& values, std::size_t buffer,
                                   std::uint8_t channel)
    : dispatcher_(&dispatcher),
      channels_(&values.channels()),
      server_(values, buffer, channel),
      pump_(dispatcher, *this),
      number_(channel) {}

void SdoServerService::start(SdoChannel channel) {
  stop();
  channel_ = channel;
  if (!channel.valid()) return;
  server_.set_response_id(channel.response);
  dispatcher_->add(can::only(channel.request.key()), *this);
}

void SdoServerService::stop() noexcept {
  dispatcher_->remove(*this);
  cancel();
  pump_.stop();
  server_.reset();
  unsent_.reset();
  if (channel_.valid() && channels_->relay() != nullptr) channels_->relay()->stopped(number_);
  channel_ = {};
}

void SdoServerService::received(const can::Frame& frame, rt::Time at) noexcept {
  if (channels_->relay() != nullptr && sdo::well_formed(frame)) [[unlikely]] {
    if (channels_->relay()->request(number_, std::span(frame.data).first<8>())) return;
  }
  can::Frame reply;
  const bool pumping = pump_.running();
  const bool has_reply = server_.handle(frame, reply);
  heard_ = at;
  unsent_.reset();  // a client that asks anew no longer waits for the earlier answer
  if (has_reply) {
    if (pumping) pump_.stop();
    return answer(reply);
  }
  if (server_.sending() && (!pumping || server_.segments().sent() == 0)) {
    cancel_timer();
    return pump_.start(server_.segments(), channel_.response, timeout_);
  }
  if (pumping && !server_.busy()) pump_.stop();
  if (!pump_.running()) arm();
}

void SdoServerService::answer(const can::Frame& frame) noexcept {
  if (dispatcher_->send(frame) != can::Queued::full) return arm();
  unsent_ = can::PackedFrame(frame);
  unsent_until_ = dispatcher_->executor().now() + timeout_;
  dispatcher_->executor().after(full_retry, *this);
}

bool SdoServerService::send(od::ChannelBytes bytes) noexcept {
  if (!channel_.valid()) return false;
  can::Frame frame;
  sdo::address(frame, channel_.response);
  std::ranges::copy(bytes, frame.data.begin());
  return dispatcher_->send(frame) == can::Queued::yes;
}

bool SdoServerService::complete(AbortCode code) noexcept {
  const auto object = server_.pending();
  return object && complete(*object, code);
}

bool SdoServerService::complete(ObjectRef object, AbortCode code, ObjectRef named) noexcept {
  if (server_.pending() != object || code == AbortCode::pending) return false;
  auto reply = server_.complete(code);
  if (reply) {
    const auto command = sdo::specifier(reply->data[0]);
    const bool names = command == static_cast<std::uint8_t>(sdo::Scs::download) || code != AbortCode::none;
    if (names && named != object) sdo::rename(*reply, named);
    answer(*reply);
  } else if (server_.sending()) {
    cancel_timer();
    pump_.start(server_.segments(), channel_.response, timeout_);
  }
  return true;
}

// A timer that fires sooner is left alone: `run` checks how long ago the client was heard.
void SdoServerService::arm() noexcept {
  if (!server_.busy() || server_.pending() || timeout_ <= rt::Duration::zero()) return cancel_timer();
  const auto due = dispatcher_->executor().now() + patience();
  if (!timed() || this->due() > due) dispatcher_->executor().at(due, *this);
}

void SdoServerService::pumped(rt::Time at) noexcept {
  heard_ = at;
  arm();
}

void SdoServerService::stuck(can::Queued why) noexcept {
  if (why != can::Queued::full) return server_.reset();
  after_timeout();
}

void SdoServerService::after_timeout() noexcept {
  if (const auto frame = server_.expire()) answer(*frame);
}

void SdoServerService::run() noexcept {
  auto& executor = dispatcher_->executor();
  if (unsent_) {
    const bool full = dispatcher_->send(unsent_->unpacked()) == can::Queued::full;
    const bool go_on = timeout_ <= rt::Duration::zero() || executor.now() < unsent_until_;
    if (full && go_on) return executor.after(full_retry, *this);
    unsent_.reset();
    heard_ = executor.now();
    return arm();
  }
  if (!server_.busy() || server_.pending()) return;
  const auto due = heard_ + patience();
  if (due > executor.now()) return executor.at(due, *this);
  after_timeout();
}

}  // namespace berth::co

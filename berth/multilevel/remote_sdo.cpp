#include "berth/multilevel/remote_sdo.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/co/sdo.hpp"

namespace berth::multilevel {
namespace {

using co::sdo::Ccs;
using co::sdo::Scs;
using od::AbortCode;

constexpr std::uint8_t indication = 0xE0;
constexpr std::uint8_t block_ended = 0xA1;  // from the server of a download, from the client of an upload

can::Frame frame_to(std::uint32_t id, od::ChannelBytes bytes) noexcept {
  can::Frame frame;
  frame.set_head(id, 8);
  std::ranges::copy(bytes, frame.data.begin());
  return frame;
}

}  // namespace

// One transfer through the router.
class RemoteSdo::Way final : private can::Handler, private rt::Job {
 public:
  Way(RemoteSdo& owner, std::uint8_t channel) noexcept : owner_(&owner), channel_(channel) {}

  void begin(const RemoteNetwork& network, NodeId node) {
    end();
    beneath_ = network.beneath;
    node_ = node;
    kind_ = Kind::nothing;
    last_ = begun_ = false;
    beneath_->add(can::only(co::sdo_response_id(node)), *this);
    arm();
  }
  void end() noexcept {
    if (beneath_ != nullptr) beneath_->remove(*this);
    beneath_ = nullptr;
    cancel();
  }
  [[nodiscard]] bool open() const noexcept { return beneath_ != nullptr; }

  // A frame from the client.
  void down(od::ChannelBytes bytes) noexcept {
    const auto command = static_cast<Ccs>(co::sdo::specifier(bytes[0]));
    if (kind_ == Kind::nothing) {
      kind_ = kind_of(bytes[0]);
      object_ = {load_le<std::uint16_t>(bytes.data() + 1), bytes[3]};
    }
    const bool segments_end = kind_ == Kind::download && command == Ccs::download_segment && (bytes[0] & 1U) != 0;
    last_ = segments_end || kind_ == Kind::expedited;
    static_cast<void>(beneath_->send(frame_to(co::sdo_request_id(node_), bytes)));
    const bool aborted = kind_ != Kind::block_download ? command == Ccs::abort : bytes[0] == 0x80;
    if (aborted || (kind_ == Kind::block_upload && bytes[0] == block_ended)) return end();
    arm();
  }

 private:
  enum class Kind : std::uint8_t { nothing, expedited, download, upload, block_download, block_upload };

  static Kind kind_of(std::uint8_t byte) noexcept {
    switch (static_cast<Ccs>(co::sdo::specifier(byte))) {
      case Ccs::download: return (byte & 0x02U) != 0 ? Kind::expedited : Kind::download;
      case Ccs::upload: return Kind::upload;
      case Ccs::block_download: return Kind::block_download;
      case Ccs::block_upload: return Kind::block_upload;
      default: return Kind::nothing;
    }
  }
  // A frame from the server.
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (!co::sdo::well_formed(frame)) return;
    const auto bytes = std::span(frame.data).first<8>();
    const auto command = static_cast<Scs>(co::sdo::specifier(bytes[0]));
    static_cast<void>(owner_->upper_->channels().send(channel_, bytes));
    // The server of a block upload may switch to segments.
    if (kind_ == Kind::block_upload && !begun_ && command == Scs::upload) kind_ = Kind::upload;
    begun_ = begun_ || kind_ != Kind::nothing;
    if (ends(bytes[0], command)) return end();
    arm();
  }
  [[nodiscard]] bool ends(std::uint8_t byte, Scs command) const noexcept {
    switch (kind_) {
      case Kind::block_upload: return byte == 0x80;  // anything else may be a segment
      case Kind::block_download: return command == Scs::abort || byte == block_ended;
      case Kind::upload:
        if (command == Scs::upload) return (byte & 0x02U) != 0;
        return command == Scs::abort || (command == Scs::upload_segment && (byte & 0x01U) != 0);
      default: return command == Scs::abort || last_;
    }
  }
  void arm() noexcept { owner_->executor().after(owner_->timeout_, *this); }
  // Neither side sent a frame in time.
  void run() noexcept override {
    can::Frame abort;
    co::sdo::put_abort(abort, object_, AbortCode::timeout);
    const auto bytes = std::span<const std::uint8_t>(abort.data).first<8>();
    static_cast<void>(beneath_->send(frame_to(co::sdo_request_id(node_), bytes)));
    static_cast<void>(owner_->upper_->channels().send(channel_, bytes));
    end();
  }

  RemoteSdo* owner_;
  can::Dispatcher* beneath_ = nullptr;
  NodeId node_;
  std::uint8_t channel_;
  Kind kind_ = Kind::nothing;
  ObjectRef object_;
  bool last_ = false;   // the next answer ends the transfer
  bool begun_ = false;  // the server has answered
};

RemoteSdo::RemoteSdo(rt::Executor& executor, od::Values& upper, std::vector<RemoteNetwork> networks,
                     rt::Duration timeout)
    : executor_(&executor), upper_(&upper), networks_(std::move(networks)), timeout_(timeout) {
  for (std::size_t channel = 0; channel < ways_.size(); ++channel) {
    const bool serves =
        channel == 0 || upper.description().find(static_cast<std::uint16_t>(0x1200 + channel)) != nullptr;
    if (serves) ways_[channel] = std::make_unique<Way>(*this, static_cast<std::uint8_t>(channel));
  }
  upper.channels().set_relay(this);
}

RemoteSdo::~RemoteSdo() { upper_->channels().set_relay(nullptr); }

std::size_t RemoteSdo::busy() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(ways_, [](const auto& way) { return way && way->open(); }));
}

bool RemoteSdo::request(std::uint8_t channel, od::ChannelBytes bytes) noexcept {
  auto& way = ways_[channel % ways_.size()];
  if (!way) return false;
  if (way->open()) {
    way->down(bytes);
    return true;
  }
  if (static_cast<Ccs>(co::sdo::specifier(bytes[0])) != Ccs::network) return false;
  indicated(channel, bytes);
  return true;
}

void RemoteSdo::stopped(std::uint8_t channel) noexcept {
  auto& way = ways_[channel % ways_.size()];
  if (way) way->end();
}

void RemoteSdo::refuse(std::uint8_t channel, od::ChannelBytes bytes, AbortCode code) noexcept {
  can::Frame abort;
  co::sdo::put_abort(abort, {load_le<std::uint16_t>(bytes.data() + 1), bytes[3]}, code);
  static_cast<void>(upper_->channels().send(channel, std::span<const std::uint8_t>(abort.data).first<8>()));
}

void RemoteSdo::indicated(std::uint8_t channel, od::ChannelBytes bytes) noexcept {
  const auto number = load_le<std::uint16_t>(bytes.data() + 1);
  if (number == 0) {
    static_cast<void>(upper_->channels().send(channel, bytes));
    return;
  }
  const auto network = std::ranges::find(networks_, number, &RemoteNetwork::network);
  const bool good_node = bytes[3] >= 1 && bytes[3] <= 127;
  if (network == networks_.end() || !good_node) return refuse(channel, bytes, AbortCode::no_sdo_connection);
  const bool far = network->router.configured();
  const NodeId next = far ? network->router : NodeId(bytes[3]);
  if (network->client != nullptr && network->client->busy(next)) {
    return refuse(channel, bytes, AbortCode::local_control);
  }
  auto& way = *ways_[channel];
  way.begin(*network, next);
  if (far) {
    way.down(bytes);  // the next router confirms
  } else {
    static_cast<void>(upper_->channels().send(channel, bytes));
  }
}

// ---- the client ----

namespace {

// `co_await`: sends the indication and waits for its confirmation.
class Indication final : public rt::Operation<Indication>, private can::Handler, private rt::Job {
 public:
  Indication(can::Dispatcher& dispatcher, NodeId router, std::uint16_t network, NodeId node, rt::Duration timeout)
      : dispatcher_(&dispatcher), router_(router), timeout_(timeout) {
    request_.set_head(co::sdo_request_id(router), 8);
    request_.data[0] = indication;
    store_le(request_.data.data() + 1, network);
    request_.data[3] = node.value();
  }
  bool start() noexcept {
    dispatcher_->add(can::only(co::sdo_response_id(router_)), *this);
    if (dispatcher_->send(request_) != can::Queued::yes) {
      error_ = {.code = Errc::bus, .text = "the network indication never left"};
      dispatcher_->remove(*this);
      return false;
    }
    dispatcher_->executor().after(timeout_, *this);
    return true;
  }
  Result<void> await_resume() const noexcept {
    if (error_) return fail(*error_);
    return {};
  }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (!co::sdo::well_formed(frame)) return;
    const bool abort = static_cast<Scs>(co::sdo::specifier(frame.data[0])) == Scs::abort;
    if (abort) {
      const auto code = co::sdo::abort_code(frame);
      done(Error{.code = Errc::aborted, .detail = static_cast<std::uint32_t>(code), .text = od::text(code)});
    } else if (std::ranges::equal(frame.bytes(), request_.bytes())) {
      done(std::nullopt);
    }
  }
  void run() noexcept override { done(Error{.code = Errc::timeout, .text = "no answer of the router"}); }
  void done(std::optional<Error> error) noexcept {
    error_ = error;
    cancel();
    dispatcher_->remove(*this);
    finish();
  }
  can::Dispatcher* dispatcher_;
  NodeId router_;
  rt::Duration timeout_;
  can::Frame request_;
  std::optional<Error> error_;
};

}  // namespace

Error RemoteAccess::about(const Error& error) const noexcept {
  Error told = error;
  told.node = node_.value();
  const bool silent = error.code == Errc::aborted && error.detail == static_cast<std::uint32_t>(AbortCode::timeout);
  if (silent) told = {.code = Errc::timeout, .node = node_.value(), .text = "no answer beyond the router"};
  return told;
}

rt::Task<Result<co::SdoOptions>> RemoteAccess::reach() {
  co::SdoOptions options = client_->options();
  options.timeout *= 2;
  Indication request(*dispatcher_, router_, network_, node_, options.timeout);
  const auto indicated = co_await request;
  if (!indicated) co_return fail(about(indicated.error()));
  co_return options;
}

rt::Task<Result<co::SdoValue>> RemoteAccess::read(std::uint16_t index, std::uint8_t sub) {
  co_await turn_->take();
  const rt::Held held(*turn_);
  const auto options = co_await reach();
  if (!options) co_return fail(options.error());
  auto value = co_await client_->upload(router_, index, sub, *options);
  if (!value) co_return fail(about(value.error()));
  co_return value;
}

rt::Task<Result<void>> RemoteAccess::write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) {
  co_await turn_->take();
  const rt::Held held(*turn_);
  const auto options = co_await reach();
  if (!options) co_return fail(options.error());
  const auto done = co_await client_->download(router_, index, sub, data, *options);
  if (!done) co_return fail(about(done.error()));
  co_return Result<void>();
}

}  // namespace berth::multilevel

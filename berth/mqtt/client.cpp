#include "berth/mqtt/client.hpp"

#include <utility>

#include "berth/mqtt/core_parts.hpp"
#include "berth/mqtt/login.hpp"
#include "berth/mqtt/tls.hpp"

namespace berth::mqtt {

// The files are read here too: a wrong name is told at once, and not at the first attempt.
tl::expected<std::unique_ptr<Client>, std::string> Client::start(Thread& thread, Options options, Random random,
                                                                 Handler& handler) {
  if (auto wrong = complaint(options); !wrong.empty()) return tl::unexpected(std::move(wrong));
  if (!options.login_file.empty()) {
    const auto login = read_login(options.login_file);
    if (!login) return tl::unexpected(login.error());
  }
  if (options.where.tls) {
    const auto tls = Tls::load(options.tls, options.where.host);
    if (!tls) return tl::unexpected(tls.error());
  }
  auto core = std::make_shared<Core>(*thread.hub_, std::move(options), random, handler);
  thread.hub_->join(core);
  return std::unique_ptr<Client>(new Client(std::move(core)));
}

Client::Client(std::shared_ptr<Core> core) noexcept : core_(std::move(core)) {}

Client::~Client() {
  core_->hub().leave(core_);
  core_->postbox().wait_until_gone();
}

tl::expected<MessageId, Refusal> Client::publish(Message message) noexcept {
  auto letter = core_->postbox().accept(std::move(message));
  if (!letter) return tl::unexpected(letter.error());
  const MessageId id = letter->id;
  if (core_->hub().is_here()) {
    core_->add(std::move(*letter));
  } else {
    core_->postbox().put(std::move(*letter));
  }
  core_->hub().wake(*core_);
  return id;
}

void Client::end(Parting parting) noexcept {
  if (core_->postbox().ask_to_part(parting)) core_->hub().wake(*core_);
}

bool Client::has_ended() const noexcept { return core_->postbox().has_ended(); }

Counts Client::counts() const noexcept { return core_->postbox().counts(); }

}  // namespace berth::mqtt

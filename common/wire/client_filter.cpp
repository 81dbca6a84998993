#include "common/wire/client_filter.h"

#include <fastdds/dds/topic/IContentFilter.hpp>
#include <memory>
#include <new>

#include "common/options/number_text.h"
#include "common/wire/sample_type.h"

namespace cairn::wire {
namespace {

namespace fd = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

// The library's interfaces have no virtual destructor; what is made here is destroyed here, as what it is.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"
class ClientFilter final : public fd::IContentFilter {
 public:
  explicit ClientFilter(ClientId client) : client_(client) {}
  // What is not plain CDR passes: the reader decides.
  bool evaluate(const SerializedPayload& payload, const FilterSampleInfo& /*info*/,
                const GUID_t& /*reader*/) const override {
    const std::optional<ClientId> client = PeekClient(payload.data, payload.length);
    return !client || *client == client_;
  }

 private:
  const ClientId client_;
};

class ClientFilterFactory final : public fd::IContentFilterFactory {
 public:
  // Called for our own readers, and with whatever a peer announces. A filter is replaced if its expression changes.
  ReturnCode_t create_content_filter(const char* /*filter_class_name*/, const char* /*type_name*/,
                                     const fd::TopicDataType* /*data_type*/, const char* filter_expression,
                                     const ParameterSeq& /*filter_parameters*/,
                                     fd::IContentFilter*& filter_instance) override {
    if (filter_expression == nullptr) {  // Only the parameters change, and there are none.
      return filter_instance != nullptr ? ReturnCode_t::RETCODE_OK : ReturnCode_t::RETCODE_BAD_PARAMETER;
    }
    const std::optional<ClientId> client = ClientOfExpression(filter_expression);
    if (!client) return ReturnCode_t::RETCODE_BAD_PARAMETER;
    auto made = std::unique_ptr<ClientFilter>(new (std::nothrow) ClientFilter(*client));
    if (made == nullptr) return ReturnCode_t::RETCODE_OUT_OF_RESOURCES;
    delete static_cast<ClientFilter*>(filter_instance);
    filter_instance = made.release();
    return ReturnCode_t::RETCODE_OK;
  }

  ReturnCode_t delete_content_filter(const char* /*filter_class_name*/, fd::IContentFilter* filter_instance) override {
    delete static_cast<ClientFilter*>(filter_instance);
    return ReturnCode_t::RETCODE_OK;
  }
};
#pragma GCC diagnostic pop

}  // namespace

std::string ClientExpression(ClientId client) {
  return std::to_string(client);
}

std::optional<ClientId> ClientOfExpression(std::string_view expression) {
  ClientId client = 0;
  if (!ParseNumber(expression, client)) return std::nullopt;
  return client;
}

fd::IContentFilterFactory& ClientFilters() {
  static ClientFilterFactory& factory = *new ClientFilterFactory();
  return factory;
}

}  // namespace cairn::wire

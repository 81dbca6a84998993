// The patterns of lines and corners that thesis A prints for the scans of its Figures 3.15 and 3.16. A row
// has an entry for each following line; what is missing at its end is blank.
#pragma once

#include <vector>

namespace cairn::slam::test {

using Rows = std::vector<std::vector<double>>;

// Table 3.13 and Table 3.14, degrees; printed zeros at the ends of rows are blanks.
inline const Rows kPrevAngles{{1.4085, -87.9693, -88.4311, 2.3449, -89.4927},
                              {-89.3777, -89.8395, .9365, -90.9011, -180.3647},
                              {-.4618, 90.3142, -1.5234, -90.9870, -91.8016},
                              {90.7760, -1.0616, -90.5252, -91.3399},
                              {-91.8376, -181.3012, -182.1158},
                              {-89.4636, -90.2783},
                              {-.8147},
                              {}};
inline const Rows kCurrAngles{{-91.7365, -90.5958, -181.5675, -181.1587, -89.4536},
                              {1.1407, -89.8309, -89.4221, 2.2829, -90.5593},
                              {-90.9717, -90.5629, 1.1422, -91.7001, -182.5422},
                              {.4088, 92.1138, -.7284, -91.5705, -89.9596},
                              {91.7050, -1.1372, -91.9794, -90.3684},
                              {-92.8423, -183.6844, -182.0734},
                              {-90.8421, -89.2312},
                              {1.6110},
                              {}};

// Table 3.19 and Table 3.20; printed 100 and 200 are blanks.
inline const Rows kPrevDistances{{.4144, 2.7908, 2.9215, 1.9227, 2.7909},
                                 {2.3765, 2.5273, 1.5083, 2.3765},
                                 {.8832, .8690, .0453},
                                 {1.2123, .8379},
                                 {.8682},
                                 {},
                                 {}};
inline const Rows kCurrDistances{{3.7364, 3.4230, 2.4693, 1.6257, 2.6171},
                                 {.4338, 2.8394, 2.9506, 1.9395, 2.8394},
                                 {2.4056, 2.5380, 1.5057, 2.4056},
                                 {.8435, .8999, .0015},
                                 {1.2254, .8451},
                                 {.8999},
                                 {}};

}  // namespace cairn::slam::test

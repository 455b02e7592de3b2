#define DUET_EIGEN Eigen_v2
#define DUET_KERNEL kDenseKernelsV2
#define DUET_LEVEL InstructionSet::kV2
#include "duet/nn/dense_kernels_body.h"
